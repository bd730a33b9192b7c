#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "disparity_refinement/visualization/Panels.hpp"
#include "disparity_refinement/visualization/RefinementPicture.hpp"

namespace disparity_refinement {
namespace {

RefinementPicture smallPicture() {
  RefinementPicture picture;
  picture.image = cv::Mat(40, 60, CV_8UC1, cv::Scalar(100));
  picture.labels = cv::Mat(40, 60, CV_32SC1, cv::Scalar(0));
  picture.labels(cv::Rect(0, 0, 30, 40)).setTo(1);
  picture.disparity = cv::Mat(40, 60, CV_32FC1, cv::Scalar(-1));
  picture.refined = cv::Mat(40, 60, CV_32FC1, cv::Scalar(20));
  return picture;
}

TEST(RefinementPicture, hasTheErrorsIfTheTruthIsKnown) {
  RefinementPicture picture = smallPicture();
  const cv::Mat without = drawRefinement(picture);
  picture.ground_truth = cv::Mat(40, 60, CV_32FC1, cv::Scalar(20));
  const cv::Mat with = drawRefinement(picture);
  EXPECT_EQ(with.type(), CV_8UC3);
  EXPECT_EQ(with.cols, without.cols);
  EXPECT_EQ(2 * with.rows, 3 * without.rows) << "three rows of panels instead of two";
  // The refined map is right everywhere, the other has no disparity: green and grey in the last row.
  EXPECT_EQ(with.at<cv::Vec3b>(with.rows - 5, with.cols - 5), cv::Vec3b(0, 160, 0));
  EXPECT_EQ(with.at<cv::Vec3b>(with.rows - 5, 5), cv::Vec3b(128, 128, 128));
}

TEST(RefinementPicture, bothMapsHaveOneScale) {
  RefinementPicture picture = smallPicture();
  picture.disparity.setTo(20);
  const cv::Mat drawn = drawRefinement(picture);
  EXPECT_EQ(drawn.at<cv::Vec3b>(drawn.rows - 5, 5), drawn.at<cv::Vec3b>(drawn.rows - 5, drawn.cols - 5));
  picture.disparity.setTo(30);
  const cv::Mat other = drawRefinement(picture);
  EXPECT_NE(other.at<cv::Vec3b>(drawn.rows - 5, 5), other.at<cv::Vec3b>(drawn.rows - 5, drawn.cols - 5));
}

TEST(RefinementPicture, takesColourImages) {
  RefinementPicture picture = smallPicture();
  picture.image = cv::Mat(40, 60, CV_8UC3, cv::Scalar(1, 2, 3));
  EXPECT_NO_THROW(drawRefinement(picture));
}

TEST(RefinementPicture, refusesImagesOfDifferentSize) {
  RefinementPicture picture = smallPicture();
  picture.refined = cv::Mat(40, 61, CV_32FC1, cv::Scalar(20));
  EXPECT_THROW(drawRefinement(picture), std::invalid_argument);
  picture = smallPicture();
  picture.labels = cv::Mat();
  EXPECT_THROW(drawRefinement(picture), std::invalid_argument);
}

TEST(Panels, refusesWhatIsNoPicture) {
  const Panel good{"good", cv::Mat(10, 20, CV_8UC1, cv::Scalar(1))};
  const int sizes[] = {10, 20, 2};
  for (const cv::Mat& bad : {cv::Mat(), cv::Mat(10, 20, CV_16UC1), cv::Mat(3, sizes, CV_8UC1)}) {
    EXPECT_THROW(arrangePanels({{"bad", bad}}, 1), std::invalid_argument);
    EXPECT_THROW(arrangePanels({good, {"bad", bad}}, 2), std::invalid_argument);
  }
  EXPECT_THROW(arrangePanels({good, {"low", cv::Mat(9, 20, CV_8UC1)}}, 2), std::invalid_argument);
}

TEST(Panels, needsNoMoreColumnsThanPanels) {
  const Panel panel{"a", cv::Mat(10, 20, CV_8UC1, cv::Scalar(1))};
  const cv::Size size = arrangePanels({panel, panel}, 2).size();
  EXPECT_EQ(arrangePanels({panel, panel}, 3).size(), size);
  EXPECT_EQ(arrangePanels({panel, panel}, std::numeric_limits<int>::max()).size(), size);
}

}  // namespace
}  // namespace disparity_refinement
