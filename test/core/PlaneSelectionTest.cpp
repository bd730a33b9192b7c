#include <gtest/gtest.h>

#include <vector>

#include "PlaneScene.hpp"
#include "disparity_refinement/refinement/PlaneSelection.hpp"

namespace disparity_refinement {
namespace {

const DisparityPlane UNKNOWN;
const DisparityPlane ROAD{0.125, 0.25, 10.0, true}, WALL{-0.25, 0.0, 40.0, true};

void expectPlane(const DisparityPlane& actual, const DisparityPlane& expected) {
  EXPECT_EQ(actual.is_known, expected.is_known);
  EXPECT_EQ(actual.a, expected.a);
  EXPECT_EQ(actual.b, expected.b);
  EXPECT_EQ(actual.c, expected.c);
}

// Segments 0, 1 ... side by side, `width` pixels wide each.
PlaneScene stripes(int segments, int width = 10, int height = 12) {
  PlaneScene scene({segments * width, height});
  for (int i = 0; i < segments; ++i) scene.labels.colRange(i * width, (i + 1) * width).setTo(i);
  return scene;
}

std::vector<DisparityPlane> select(const PlaneScene& scene, const PlaneSelectionParameters& parameters = {}) {
  std::vector<DisparityPlane> planes;
  selectPlanes(scene.graph, scene.support, parameters, scene.planes, planes);
  return planes;
}

PlaneSelectionParameters sweeps(int n) {
  PlaneSelectionParameters parameters;
  parameters.sweeps = n;
  return parameters;
}

TEST(PlaneSelection, givesASegmentBetweenTwoPartsOfAPlaneThatPlane) {
  PlaneScene scene = stripes(3);
  scene.measure(0, ROAD);
  scene.measure(2, ROAD);
  scene.prepare();
  scene.planes = {ROAD, UNKNOWN, ROAD};
  for (const DisparityPlane& plane : select(scene)) expectPlane(plane, ROAD);
  // So too if what it has is wrong and nothing speaks for it.
  scene.planes[1] = WALL;
  for (const DisparityPlane& plane : select(scene)) expectPlane(plane, ROAD);
}

TEST(PlaneSelection, keepsMeasuredPlanesAtADepthStep) {
  PlaneScene scene = stripes(2);
  scene.measure(0, ROAD);
  scene.measure(1, WALL);
  scene.prepare();
  scene.planes = {ROAD, WALL};
  const auto planes = select(scene);
  expectPlane(planes[0], ROAD);
  expectPlane(planes[1], WALL);
}

TEST(PlaneSelection, weighsTheStepAgainstTheSupport) {
  // A row of 12 border points with steps of 1 px; what was measured lies 1 px off the neighbour's plane too.
  const DisparityPlane low{0.0, 0.0, 20.0, true}, high{0.0, 0.0, 21.0, true};
  PlaneScene scene = stripes(2);
  scene.measure(0, low);
  scene.measured(cv::Rect(10, 0, 4, 12)).setTo(21.0F);  // 48 pixels: costs of 48 px against 4 * 12 px.
  scene.prepare();
  scene.planes = {low, high};
  PlaneSelectionParameters parameters;
  parameters.border_weight = 3.9;
  expectPlane(select(scene, parameters)[1], high);
  parameters.border_weight = 4.1;
  expectPlane(select(scene, parameters)[1], low);
  // A contrast at the border takes half of the weight.
  scene.gray.colRange(10, 20).setTo(110);
  scene.prepare(10.0);
  expectPlane(select(scene, parameters)[1], high);
  parameters.border_weight = 7.9;
  expectPlane(select(scene, parameters)[1], high);
  parameters.border_weight = 8.1;
  expectPlane(select(scene, parameters)[1], low);
}

TEST(PlaneSelection, countsDistancesUpToTheTruncationsOnly) {
  const DisparityPlane low{0.0, 0.0, 20.0, true}, high{0.0, 0.0, 30.0, true};
  PlaneScene scene = stripes(2);
  scene.measure(0, low);
  scene.measured(cv::Rect(10, 0, 4, 12)).setTo(30.0F);  // 48 pixels, 12 border points.
  scene.prepare();
  scene.planes = {low, high};
  PlaneSelectionParameters parameters;
  parameters.border_weight = 1.0;
  parameters.data_truncation = 1.0;     // 48
  parameters.border_truncation = 3.75;  // 45
  expectPlane(select(scene, parameters)[1], high);
  parameters.border_truncation = 4.25;  // 51
  expectPlane(select(scene, parameters)[1], low);
  parameters.data_truncation = 1.25;  // 60
  expectPlane(select(scene, parameters)[1], high);
}

TEST(PlaneSelection, countsEveryPixelOfALargeSupport) {
  // 240 pixels, of which 64 are looked at, against 60 border points, of which 20 are.
  const DisparityPlane low{0.0, 0.0, 20.0, true}, high{0.0, 0.0, 21.0, true};
  PlaneScene scene = stripes(2, 10, 60);
  scene.measure(0, low);
  scene.measured(cv::Rect(12, 0, 4, 60)).setTo(21.0F);
  scene.prepare();
  scene.planes = {low, high};
  PlaneSelectionParameters parameters;
  parameters.border_weight = 3.9;
  expectPlane(select(scene, parameters)[1], high);
  parameters.border_weight = 4.1;
  expectPlane(select(scene, parameters)[1], low);
}

TEST(PlaneSelection, changesNothingWithoutSweeps) {
  PlaneScene scene = stripes(3);
  scene.measure(0, ROAD);
  scene.prepare();
  scene.planes = {ROAD, UNKNOWN, WALL};
  const auto planes = select(scene, sweeps(0));
  expectPlane(planes[0], ROAD);
  expectPlane(planes[1], UNKNOWN);
  expectPlane(planes[2], WALL);
}

TEST(PlaneSelection, carriesPlanesOverSegmentsWithoutAny) {
  for (const int source : {0, 3, 7}) {
    PlaneScene scene = stripes(8, 3, 4);
    scene.measure(source, ROAD);
    scene.prepare();
    scene.planes[source] = ROAD;
    // Once forth and once back is enough for any place.
    for (const DisparityPlane& plane : select(scene, sweeps(2))) expectPlane(plane, ROAD);
    // Forth: nothing goes further back than one segment.
    const auto once = select(scene, sweeps(1));
    for (int i = 0; i < 8; ++i) expectPlane(once[i], i >= source - 1 ? ROAD : UNKNOWN);
  }
}

TEST(PlaneSelection, choosesThePlaneThatContinuesMoreNeighbours) {
  // Segment 0 in the middle without support; the border to the road above and below it is longer than that to
  // the wall at its right.
  PlaneScene scene({40, 12});
  scene.labels.colRange(16, 40).setTo(3);
  scene.labels(cv::Rect(0, 0, 16, 4)).setTo(1);
  scene.labels(cv::Rect(0, 8, 16, 4)).setTo(2);
  scene.measure(1, ROAD);
  scene.measure(2, ROAD);
  scene.measure(3, WALL);
  scene.prepare();
  scene.planes = {UNKNOWN, ROAD, ROAD, WALL};
  auto planes = select(scene);
  expectPlane(planes[0], ROAD);
  expectPlane(planes[3], WALL);
  // The contrast of an edge makes the long border weigh less than the short one.
  scene.gray.rowRange(0, 4).setTo(250);
  scene.gray.rowRange(8, 12).setTo(250);
  scene.prepare();
  scene.planes = {UNKNOWN, ROAD, ROAD, WALL};
  planes = select(scene);
  expectPlane(planes[0], WALL);
  expectPlane(planes[1], ROAD);
  expectPlane(planes[2], ROAD);
}

TEST(PlaneSelection, comesBackToTheFittedPlane) {
  // Segment 1, 48 pixels of support, has steps of at most 1 px to both sides, 60 px each. It takes its right
  // neighbour's plane first (48 + 60 instead of 60 + 60), but that becomes `far` soon after.
  const DisparityPlane low{0.0, 0.0, 20.0, true}, high{0.0, 0.0, 21.0, true}, far{0.0, 0.0, 10.0, true};
  PlaneScene scene = stripes(4);
  for (const int i : {0, 2, 3}) scene.measure(i, far);
  scene.measured(cv::Rect(10, 0, 4, 12)).setTo(20.0F);
  scene.prepare();
  scene.planes = {far, low, high, far};
  PlaneSelectionParameters parameters;
  parameters.border_weight = 5.0;
  parameters.border_truncation = 1.0;
  parameters.data_truncation = 3.0;
  parameters.sweeps = 1;
  const auto once = select(scene, parameters);
  expectPlane(once[1], high);
  expectPlane(once[2], far);
  // 60 + 60 instead of 48 + 60 + 60; or 3 * 48 for `far`.
  parameters.sweeps = 2;
  expectPlane(select(scene, parameters)[1], low);
}

TEST(PlaneSelection, leavesWhatIsUnknownEverywhere) {
  PlaneScene scene = stripes(4);
  scene.measured.setTo(20.0F);
  scene.prepare();
  for (const DisparityPlane& plane : select(scene)) expectPlane(plane, UNKNOWN);
  std::vector<DisparityPlane> planes(3);
  selectPlanes(scene.graph, {}, {}, {}, planes);
  EXPECT_TRUE(planes.empty());
}

TEST(PlaneSelection, leavesSegmentsThatNoKnownPlaneReaches) {
  PlaneScene scene = stripes(4);
  scene.labels.colRange(10, 20).setTo(-1);  // Between segment 0 and the others; label 1 does not occur.
  scene.measure(0, ROAD);
  scene.prepare();
  scene.planes[0] = ROAD;
  const auto planes = select(scene);
  expectPlane(planes[0], ROAD);
  for (const int i : {1, 2, 3}) expectPlane(planes[i], UNKNOWN);
}

}  // namespace
}  // namespace disparity_refinement
