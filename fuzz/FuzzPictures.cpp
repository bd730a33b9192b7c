// Pictures, KITTI's metric and what is done to single maps: any values, sizes and scales.

#include <vector>

#include "Input.hpp"
#include "disparity_refinement/evaluation/KittiFiles.hpp"
#include "disparity_refinement/evaluation/KittiMetric.hpp"
#include "disparity_refinement/refinement/Confidence.hpp"
#include "disparity_refinement/visualization/Colorize.hpp"
#include "disparity_refinement/visualization/Panels.hpp"
#include "disparity_refinement/visualization/PlanePatches.hpp"
#include "disparity_refinement/visualization/RefinementPicture.hpp"

namespace disparity_refinement {
namespace fuzz {
namespace {

void requirePicture(const cv::Mat& bgr, const cv::Mat& input) {
  require(bgr.type() == CV_8UC3 && bgr.size() == input.size(), "a picture has the size of its input");
}

bool isShare(double value) { return value >= 0.0 && value <= 1.0; }

void requireScore(const KittiScore& score) {
  require(isShare(score.density), "the density is a share");
  for (const DisparityErrors& errors : {score.all, score.est}) {
    double less = 1.0;
    for (const double outliers : errors.outliers) {
      require(isShare(outliers) && outliers <= less, "shares of errors fall");
      less = outliers;
    }
    require(errors.end_point_error >= 0.0, "errors are not negative");
  }
}

void testColours(Input& input) {
  const DisparityRange range = input.range();
  const cv::Size size = input.size(30, 20);
  const Picture map = input.disparity(size, range), truth = input.disparity(size, {0.0F, 100.0F}),
                labels = input.labels(size);
  const Picture image = input.oneIn(4) ? Picture(size, CV_8UC3, 1) : input.gray(size);
  Picture bgr = input.picture(size, CV_8UC3);
  const float least = input.oneIn(3) ? input.anyNumber<float>() : range.min;
  const float most = input.oneIn(3) ? input.anyNumber<float>() : range.max;
  if (succeeds([&] { colorizeDisparity(map.mat(), range, least, most, bgr.mat()); })) {
    requirePicture(bgr.mat(), map.mat());
    for (int y = 0; y < map.mat().rows; ++y) {
      for (int x = 0; x < map.mat().cols; ++x) {
        const bool is_black = bgr.mat().at<cv::Vec3b>(y, x) == cv::Vec3b(0, 0, 0);
        require(is_black != range.isValid(map.mat().at<float>(y, x)), "black is what is invalid");
      }
    }
  }
  if (succeeds([&] { colorizeError(map.mat(), range, truth.mat(), bgr.mat()); }))
    requirePicture(bgr.mat(), map.mat());
  if (succeeds([&] { colorizeLabels(labels.mat(), bgr.mat()); })) requirePicture(bgr.mat(), labels.mat());
  if (succeeds([&] { drawSegmentBorders(image.mat(), labels.mat(), bgr.mat()); }))
    requirePicture(bgr.mat(), labels.mat());
}

std::vector<SegmentPlane> planesOf(Input& input) {
  std::vector<SegmentPlane> planes(static_cast<std::size_t>(input.number(0, 20)));
  for (SegmentPlane& plane : planes) {
    plane.a = input.oneIn(3) ? input.anyNumber<double>() : input.parameter(-2.0, 2.0);
    plane.b = input.oneIn(3) ? input.anyNumber<double>() : input.parameter(-2.0, 2.0);
    plane.c = input.oneIn(3) ? input.anyNumber<double>() : input.parameter(-10.0, 100.0);
    plane.status = input.enumeration<PlaneStatus>(0, 4);
  }
  return planes;
}

bool isFinite(const cv::Point3d& point) {
  return std::isfinite(point.x) && std::isfinite(point.y) && std::isfinite(point.z);
}

void testPlanes(Input& input) {
  const cv::Size size = input.size(40, 30);
  const Picture labels = input.labels(size), gray = input.gray(size);
  const std::vector<SegmentPlane> planes = planesOf(input);
  Picture bgr = input.picture(size, CV_8UC3);
  if (succeeds([&] { drawRefusedSegments(gray.mat(), labels.mat(), planes, bgr.mat()); }))
    requirePicture(bgr.mat(), labels.mat());

  StereoGeometry geometry;
  geometry.focal_length = input.oneIn(3) ? std::abs(input.anyNumber<float>()) : 400.0;
  geometry.baseline = input.oneIn(3) ? std::abs(input.anyNumber<float>()) : 0.5;
  const bool is_known = geometry.focal_length > 0.0 && std::isfinite(geometry.focal_length) &&
                        geometry.baseline > 0.0 && std::isfinite(geometry.baseline);
  cv::Point2d principal_point(20.0, 15.0);
  if (input.oneIn(3)) principal_point.x = input.anyNumber<double>();
  // The callers refuse others.
  if (!is_known || !std::isfinite(principal_point.x)) return;
  std::vector<PlanePatch> patches;
  if (!succeeds([&] { patches = findPlanePatches(labels.mat(), planes, geometry, principal_point); })) return;
  int last = -1;
  for (const PlanePatch& patch : patches) {
    require(patch.label > last && patch.label < static_cast<int>(planes.size()), "labels rise");
    last = patch.label;
    require(std::abs(cv::norm(patch.normal) - 1.0) < 1e-9, "normals have the length 1");
    require(isFinite(patch.centre) && std::all_of(patch.corners.begin(), patch.corners.end(), isFinite),
            "patches are finite");
    require(patch.centre.z > 0.0, "patches are before the camera");
    const cv::Vec3b colour = normalColour(patch.normal);
    require(std::max({colour[0], colour[1], colour[2]}) == 255, "colours are bright");
  }
}

void testMetric(Input& input) {
  const DisparityRange range = input.range();
  const cv::Size size = input.size(30, 20);
  const Picture map = input.disparity(size, range), truth = input.disparity(size, {0.0F, 100.0F});
  KittiScoreMean mean;
  const auto score = [&] { mean.add(scoreDisparity(map.mat(), range, truth.mat())); };
  if (succeeds(score)) requireScore(mean.mean());
  cv::Mat copy = map.mat().clone();
  if (succeeds([&] { interpolateBackground(copy, range); })) {
    const auto isValid = [&](const cv::Mat& image, int x, int y) {
      return range.isValid(image.at<float>(y, x));
    };
    for (int y = 0; y < copy.rows; ++y) {
      for (int x = 0; x < copy.cols; ++x) {
        require(!isValid(map.mat(), x, y) || copy.at<float>(y, x) == map.mat().at<float>(y, x),
                "what is valid stays");
      }
    }
  }
  cv::Mat rounded;
  if (succeeds([&] { rounded = roundToKittiPng(map.mat(), range); })) {
    for (const float d : cv::Mat_<float>(rounded)) {
      require(d == 0.0F || (d >= KITTI_PNG_RANGE.min && d <= KITTI_PNG_RANGE.max &&
                            d * 256.0F == std::round(d * 256.0F)),
              "rounded maps hold what a PNG holds");
    }
  }
  Picture sources = input.gray(size);
  succeeds([&] { findConfidence(sources.mat(), copy); });
  const std::vector<SegmentPlane> planes = planesOf(input);
  const Picture labels = input.labels(size);
  succeeds([&] { findSources(map.mat(), truth.mat(), labels.mat(), range, planes, sources.mat()); });
}

void testPanels(Input& input) {
  const cv::Size size = input.size(12, 12);
  if (input.yes()) {
    std::vector<Panel> panels(static_cast<std::size_t>(input.number(0, 4)));
    for (Panel& panel : panels) {
      panel.title = input.text(8);
      panel.picture = input.gray(size).mat().clone();
    }
    const int columns = input.parameter(1, 5);
    cv::Mat sheet;
    if (succeeds([&] { sheet = arrangePanels(panels, columns); }))
      require(sheet.type() == CV_8UC3, "a sheet is a picture");
    return;
  }
  RefinementPicture frame;
  frame.disparity_range = input.range();
  frame.refined_range = input.oneIn(4) ? input.range() : frame.disparity_range;
  const Picture image = input.gray(size), labels = input.labels(size),
                disparity = input.disparity(size, frame.disparity_range),
                refined = input.disparity(size, frame.refined_range),
                truth = input.disparity(size, {0.0F, 100.0F});
  frame.image = image.mat();
  frame.labels = labels.mat();
  frame.disparity = disparity.mat();
  frame.refined = refined.mat();
  if (input.yes()) frame.ground_truth = truth.mat();
  if (input.oneIn(3)) frame.scale_max = input.anyNumber<float>();
  cv::Mat picture;
  if (succeeds([&] { picture = drawRefinement(frame); }))
    require(picture.type() == CV_8UC3, "a sheet is a picture");
}

}  // namespace

void test(Input& input) {
  switch (input.number(0, 3)) {
    case 0:
      testColours(input);
      break;
    case 3:
      testPlanes(input);
      break;
    case 1:
      testMetric(input);
      break;
    default:
      testPanels(input);
  }
}

}  // namespace fuzz
}  // namespace disparity_refinement
