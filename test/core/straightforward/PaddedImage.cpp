#include "PaddedImage.hpp"

#include <cstdint>
#include <limits>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace straightforward {

void PaddedImage::assign(const cv::Mat& image) {
  requireImage(image, "image", CV_8UC1);
  const std::int64_t size = (std::int64_t{image.rows} + 2) * (std::int64_t{image.cols} + 2);
  requireArgument(size <= std::numeric_limits<std::int32_t>::max(), "image size with its frame", size,
                  "less than 2^31 px");

  cells_.create(image.rows + 2, image.cols + 2, CV_16UC1);
  cells_.row(0).setTo(FRAME);
  cells_.row(cells_.rows - 1).setTo(FRAME);
  cells_.col(0).setTo(FRAME);
  cells_.col(cells_.cols - 1).setTo(FRAME);
  image.convertTo(cells_(cv::Rect(1, 1, image.cols, image.rows)), CV_16U);
}

std::array<int, 8> PaddedImage::neighbours() const {
  const int s = cells_.cols;
  return {-1, 1, -s, s, -s - 1, -s + 1, s - 1, s + 1};
}

}  // namespace straightforward
}  // namespace disparity_refinement
