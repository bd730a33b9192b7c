// Renders a frame of the street, matches and refines it. Exits with 0 if the refined map is denser.

#include <cstdio>

#include "disparity_refinement/evaluation/SyntheticStreet.hpp"
#include "disparity_refinement/matching/StereoMatcher.hpp"
#include "disparity_refinement/refinement/DisparityRefinement.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

using namespace disparity_refinement;

int main() {
  const StreetParameters street;
  const StreetFrame frame = SyntheticStreet(street).render(0);

  MatchingParameters matching;
  matching.disparity_range = 64;
  StereoMatcher matcher(matching);
  cv::Mat disparity;
  matcher.compute(frame.left, frame.right, disparity);

  cv::Mat labels;
  Segmentation().compute(frame.left, {}, labels);

  cv::Mat refined;
  DisparityRefinement().refine(disparity, labels, frame.left, matcher.range(),
                               street.focal_length * street.baseline, {}, refined);

  const double lowest = matcher.range().min;
  const int before = cv::countNonZero(disparity >= lowest);
  const int after = cv::countNonZero(refined >= lowest);
  std::printf("pixels with a disparity: %d, refined: %d\n", before, after);
  return before > 0 && after > before ? 0 : 1;
}
