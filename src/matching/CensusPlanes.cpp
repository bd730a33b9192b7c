#include "disparity_refinement/matching/CensusPlanes.hpp"

#include <algorithm>
#include <array>
#include <cstdint>
#include <opencv2/core/hal/intrin.hpp>

#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {
namespace {

using cv::v_uint8x16;

constexpr int LANES = 16;
constexpr int RADIUS_X = CensusPlanes::WIDTH / 2, RADIUS_Y = CensusPlanes::HEIGHT / 2;

struct Offset {
  int dx, dy;
};

constexpr std::array<Offset, 16> OFFSETS = {{{-4, -3},
                                             {-2, -3},
                                             {0, -3},
                                             {2, -3},
                                             {4, -3},
                                             {-3, -2},
                                             {-1, -2},
                                             {1, -2},
                                             {3, -2},
                                             {-4, -1},
                                             {-2, -1},
                                             {0, -1},
                                             {2, -1},
                                             {4, -1},
                                             {-3, 0},
                                             {-1, 0}}};

// Eight census bits of 16 pixels; `centre` points to the first of them in an image with these rows.
v_uint8x16 censusBits(const std::uint8_t* centre, std::ptrdiff_t step, const Offset* offsets) {
  v_uint8x16 bits = cv::v_setzero_u8();
  for (int i = 0; i < 8; ++i) {
    const std::ptrdiff_t offset = offsets[i].dy * step + offsets[i].dx;
    const v_uint8x16 is_less = cv::v_load(centre + offset) < cv::v_load(centre - offset);
    bits = bits | (is_less & cv::v_setall_u8(static_cast<std::uint8_t>(1 << i)));
  }
  return bits;
}

// Half of MAX_SLOPE + Sobel's derivative, cut, of eight pixels.
cv::v_uint16x8 slopeOf(const std::uint8_t* centre, std::ptrdiff_t step) {
  const auto difference = [centre](std::ptrdiff_t row) {
    const std::uint8_t* pixel = centre + row;
    return cv::v_reinterpret_as_s16(cv::v_load_expand(pixel + 1)) -
           cv::v_reinterpret_as_s16(cv::v_load_expand(pixel - 1));
  };
  const cv::v_int16x8 middle = difference(0);
  const cv::v_int16x8 sobel = difference(-step) + middle + middle + difference(step);
  const cv::v_int16x8 most = cv::v_setall_s16(CensusPlanes::MAX_SLOPE);
  const cv::v_int16x8 least = cv::v_setall_s16(-CensusPlanes::MAX_SLOPE);
  return cv::v_reinterpret_as_u16(cv::v_max(cv::v_min(sobel, most), least) + most) >> 1;
}

}  // namespace

void CensusPlanes::compute(const cv::Mat& gray, int strips) {
  // On the right there is room for the last vector too.
  cv::copyMakeBorder(gray, padded_, RADIUS_Y, RADIUS_Y, RADIUS_X, RADIUS_X + LANES,
                     cv::BORDER_REPLICATE | cv::BORDER_ISOLATED);
  for (cv::Mat* plane : {&census[0], &census[1], &slope}) plane->create(gray.size(), CV_8UC1);
  const auto step = static_cast<std::ptrdiff_t>(padded_.step);
  forEachStrip(strips, [&](int i) {
    const cv::Range rows = stripOf(gray.rows, i, strips);
    for (int y = rows.start; y < rows.end; ++y) {
      const std::uint8_t* centre = padded_.ptr<std::uint8_t>(y + RADIUS_Y) + RADIUS_X;
      for (int x = 0; x < gray.cols; x += LANES) {
        const v_uint8x16 planes[3] = {
            censusBits(centre + x, step, OFFSETS.data()), censusBits(centre + x, step, OFFSETS.data() + 8),
            cv::v_pack(slopeOf(centre + x, step), slopeOf(centre + x + LANES / 2, step))};
        std::uint8_t* targets[3] = {census[0].ptr<std::uint8_t>(y) + x, census[1].ptr<std::uint8_t>(y) + x,
                                    slope.ptr<std::uint8_t>(y) + x};
        for (int k = 0; k < 3; ++k) {
          std::array<std::uint8_t, LANES> values;
          if (x + LANES <= gray.cols) {
            cv::v_store(targets[k], planes[k]);
          } else {
            cv::v_store(values.data(), planes[k]);
            std::copy_n(values.data(), gray.cols - x, targets[k]);
          }
        }
      }
    }
  });
}

}  // namespace disparity_refinement
