#include "disparity_refinement/matching/CensusSgm.hpp"

#include <algorithm>
#include <cstdlib>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>

#include "CensusPaths.hpp"
#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {
namespace {

// Rows of which costs and path values are kept at a time.
constexpr int BLOCK_ROWS = 24;

int blocksOf(int height) { return (height + BLOCK_ROWS - 1) / BLOCK_ROWS; }

cv::Range rowsOf(int block, int height) {
  return {block * BLOCK_ROWS, std::min((block + 1) * BLOCK_ROWS, height)};
}

const CensusPathsFunctions& functionsFor(CensusSgm::Vectors vectors) {
  const CensusPathsFunctions* wide = censusPaths32();
  const bool is_wide =
      vectors == CensusSgm::Vectors::WIDEST && wide != nullptr && cv::checkHardwareSupport(CV_CPU_AVX2);
  return is_wide ? *wide : censusPaths16();
}

// What the steps of a vertical path need for averages over rows. The path visits row after row.
class CostRows {
 public:
  // direction: 1 downwards, -1 upwards.
  CostRows(const CensusPathsFunctions& functions, const CensusPathsInput& input, const cv::Range& columns,
           int direction, cv::Mat& buffer)
      : functions_(functions),
        input_(input),
        columns_(columns),
        direction_(direction),
        here_(buffer.ptr<std::uint8_t>(0)),
        beside_(buffer.ptr<std::uint8_t>(1)) {}

  // Of any row y, and then of y + direction, y + 2 direction...
  CensusCostRows at(int y) {
    if (!input_.aggregate_rows) return {};
    if (is_first_) {
      functions_.findCosts(input_, y, columns_.start, columns_.end, here_);
      functions_.findCosts(input_, inside(y - direction_), columns_.start, columns_.end, beside_);
      is_first_ = false;
    } else {
      std::swap(here_, beside_);
    }
    return {here_, beside_, inside(y + direction_)};
  }

 private:
  int inside(int y) const { return std::clamp(y, 0, input_.height - 1); }

  const CensusPathsFunctions& functions_;
  const CensusPathsInput& input_;
  const cv::Range columns_;
  const int direction_;
  std::uint8_t *here_, *beside_;
  bool is_first_ = true;
};

}  // namespace

static_assert(CensusSgmParameters::MAX_P2 + MAX_CENSUS_COST == 255, "path values are bytes");
static_assert(CensusSgmParameters::MAX_DISPARITY_RANGE == MAX_DISPARITIES,
              "the loops' buffers are of this size");

void validate(const CensusSgmParameters& p) {
  requireArgument(p.min_disparity >= -2048 && p.min_disparity <= 2048, "min_disparity", p.min_disparity,
                  "-2048...2048");
  requireArgument(p.disparity_range >= 1 && p.disparity_range <= p.MAX_DISPARITY_RANGE, "disparity_range",
                  p.disparity_range, "1..." + std::to_string(p.MAX_DISPARITY_RANGE));
  requireArgument(p.p2 >= 0 && p.p2 <= p.MAX_P2, "P2", p.p2, "0..." + std::to_string(p.MAX_P2));
  requireArgument(p.p1 >= 0 && p.p1 <= p.p2, "P1", p.p1, "0...P2");
  requireArgument(p.uniqueness_ratio >= 0 && p.uniqueness_ratio <= 99, "uniqueness_ratio", p.uniqueness_ratio,
                  "0...99");
}

CensusSgm::CensusSgm(Vectors vectors) : functions_(&functionsFor(vectors)) {}

void CensusSgm::prepare(const cv::Size& size, const CensusSgmParameters& parameters) {
  const int disparities = parameters.disparity_range, lanes = functions_->lanes;
  vectors_ = (disparities + lanes - 1) / lanes;
  const int values = vectors_ * lanes;
  place_.resize(values);
  beyond_.resize(values);
  low_bytes_.resize(values);
  high_bytes_.resize(values);
  for (int d = 0; d < values; ++d) {
    const int place = d % vectors_ * lanes + d / vectors_;
    place_[d] = static_cast<std::uint16_t>(place);
    beyond_[place] = d < disparities ? 0 : 255;
    low_bytes_[place] = static_cast<std::uint8_t>(d % 256);
    high_bytes_[place] = static_cast<std::uint8_t>(d / 256);
  }

  ambiguous_.clear();
  if (parameters.uniqueness_ratio > 0) {
    ambiguous_.resize(256);
    for (int sum = 0; sum < 256; ++sum) {
      // The largest s with s (100 - ratio) < 100 sum.
      const int bound = (100 * sum - 1) / (100 - parameters.uniqueness_ratio);
      ambiguous_[sum] = static_cast<std::uint8_t>(sum > 0 ? std::min(bound, 255) : 0);
    }
  }

  // A phase ends with what the last vector reads beyond the last position.
  const int positions = size.width + values;
  const int phase = cv::alignSize(positions / vectors_ + lanes + 1, 32);
  for (cv::Mat& plane : mirrored_) plane.create(size.height, (2 * vectors_ - 1) * phase, CV_8UC1);
  inside_.create(1, (2 * vectors_ - 1) * phase, CV_8UC1);
  states_.create(blocksOf(size.height), size.width * values, CV_8UC1);
}

void CensusSgm::mirror(const cv::Mat (&planes)[3], int min_disparity, int threads) {
  const int vectors = vectors_, phases = 2 * vectors - 1, length = inside_.cols / phases;
  // Position j is the pixel width - 1 - min_disparity - j.
  const auto fill = [=](const std::uint8_t* row, int width, std::uint8_t* mirrored) {
    const int first = width - 1 - min_disparity;
    for (int phase = 0; phase < vectors; ++phase) {
      std::uint8_t* to = mirrored + phase * length;
      int i = 0, x = first - phase;
      for (; i < length && x >= width; x -= vectors) to[i++] = 0;
      const int end = x < 0 ? i : std::min(length, i + x / vectors + 1);
      for (; i < end; x -= vectors) to[i++] = row[x];
      std::fill(to + i, to + length, std::uint8_t{0});
    }
    for (int phase = vectors; phase < phases; ++phase) {
      const std::uint8_t* from = mirrored + (phase - vectors) * length;
      std::copy(from + 1, from + length, mirrored + phase * length);
      mirrored[(phase + 1) * length - 1] = 0;
    }
  };
  const cv::Size size = planes[0].size();
  row_inside_.assign(size.width, 255);
  fill(row_inside_.data(), size.width, inside_.ptr<std::uint8_t>());
  forEachStrip(threads, [&](int i) {
    const cv::Range rows = stripOf(size.height, i, threads);
    for (int y = rows.start; y < rows.end; ++y) {
      for (int k = 0; k < 3; ++k) {
        fill(planes[k].ptr<std::uint8_t>(y), size.width, mirrored_[k].ptr<std::uint8_t>(y));
      }
    }
  });
}

void CensusSgm::sweep(const CensusPathsInput& input, int threads) {
  const int blocks = blocksOf(input.height);
  const std::ptrdiff_t bytes = std::ptrdiff_t{vectors_} * functions_->lanes;
  for (Strip& strip : strips_) {
    strip.state.create(1, states_.cols, CV_8UC1);
    strip.cost_rows.create(2, states_.cols, CV_8UC1);
  }
  states_.row(blocks - 1) = 0;
  strips_[0].state = 0;
  forEachStrip(threads, [&](int i) {
    const cv::Range columns = stripOf(input.width, i, threads);
    const auto copy = [&](const std::uint8_t* from, std::uint8_t* to) {
      std::copy(from + columns.start * bytes, from + columns.end * bytes, to + columns.start * bytes);
    };
    const auto step = [&](CostRows& rows, int y, std::uint8_t* state) {
      functions_->step(input, y, columns.start, columns.end, rows.at(y), state);
    };
    CostRows upwards(*functions_, input, columns, -1, strips_[i].cost_rows);
    for (int block = blocks - 1; block > 0; --block) {
      std::uint8_t* state = states_.ptr<std::uint8_t>(block - 1);
      copy(states_.ptr<std::uint8_t>(block), state);
      const cv::Range rows = rowsOf(block, input.height);
      for (int y = rows.end - 1; y >= rows.start; --y) step(upwards, y, state);
    }
    // Where the strips of rows begin.
    CostRows downwards(*functions_, input, columns, 1, strips_[i].cost_rows);
    for (int strip = 1; strip < threads; ++strip) {
      std::uint8_t* state = strips_[strip].state.ptr<std::uint8_t>();
      copy(strips_[strip - 1].state.ptr<std::uint8_t>(), state);
      const cv::Range part = stripOf(blocks, strip - 1, threads);
      for (int y = part.start * BLOCK_ROWS; y < part.end * BLOCK_ROWS; ++y) step(downwards, y, state);
    }
  });
}

void CensusSgm::computeBlock(const CensusPathsInput& input, const CensusSgmParameters& parameters,
                             const cv::Range& rows, std::uint8_t* state, Strip& strip) {
  const auto costs = [&](int y) { return strip.costs.ptr<std::uint8_t>(y - rows.start); };
  const auto sums = [&](int y) { return strip.sums.ptr<std::uint8_t>(y - rows.start); };
  std::uint8_t* from_above = strip.state.ptr<std::uint8_t>();
  CostRows upwards(*functions_, input, {0, input.width}, -1, strip.cost_rows);
  for (int y = rows.end - 1; y >= rows.start; --y) {
    functions_->stepAndKeep(input, y, upwards.at(y), state, costs(y), sums(y));
  }
  functions_->addPaths(input, costs(rows.start), from_above, sums(rows.start), nullptr, nullptr);
  for (int y = rows.start + 1; y < rows.end; ++y) {
    functions_->addPaths(input, costs(y), from_above, sums(y), costs(y - 1), sums(y - 1));
    finishRow(input, parameters, y - 1, sums(y - 1), strip);
  }
  const int last = rows.end - 1;
  functions_->addPaths(input, nullptr, nullptr, nullptr, costs(last), sums(last));
  finishRow(input, parameters, last, sums(last), strip);
}

void CensusSgm::finishRow(const CensusPathsInput& input, const CensusSgmParameters& parameters, int y,
                          const std::uint8_t* sums, Strip& strip) {
  const int width = input.width;
  std::uint16_t* right = strip.right_winners.data() + input.disparities - 1;
  functions_->findWinners(input, sums,
                          {strip.winners.data(), strip.subpixel.data(), strip.is_ambiguous.data(), right});
  short* disparity = unchecked_.ptr<short>(y);
  std::uint8_t* is_bad = is_bad_.ptr<std::uint8_t>(y);
  const int max_difference =
      parameters.disp12_max_diff < 0 ? parameters.MAX_DISPARITY_RANGE : parameters.disp12_max_diff;
  for (int x = 0; x < width; ++x) {
    const int d = strip.winners[x];
    const int right_x = x - d - input.min_disparity;
    const bool is_inside = right_x >= 0 && right_x < width;
    const bool is_good =
        is_inside && strip.is_ambiguous[x] == 0 && std::abs(right[x - d] - d) <= max_difference;
    disparity[x] = static_cast<short>(SUBPIXEL_STEPS * d + strip.subpixel[x]);
    is_bad[x] = is_good ? 0 : 255;
  }
}

void CensusSgm::compute(const cv::Mat& left, const cv::Mat& right, const CensusSgmParameters& parameters,
                        cv::Mat& disparity, int threads) {
  requireImage(left, "left", CV_8UC1);
  requireImage(right, "right", CV_8UC1, left.size());
  validate(parameters);
  requireArgument(threads >= 1, "threads", threads, "at least 1");
  const cv::Size size = left.size();
  const int blocks = blocksOf(size.height);
  threads = std::min({threads, blocks, size.width});
  prepare(size, parameters);
  strips_.resize(threads);
  left_.compute(left, threads);
  right_.compute(right, threads);
  mirror({right_.census[0], right_.census[1], right_.slope}, parameters.min_disparity, threads);

  CensusPathsInput input{};
  input.width = size.width;
  input.height = size.height;
  input.disparities = parameters.disparity_range;
  input.min_disparity = parameters.min_disparity;
  input.vectors = vectors_;
  const cv::Mat* left_planes[3] = {&left_.census[0], &left_.census[1], &left_.slope};
  for (int k = 0; k < 3; ++k) {
    input.left[k] = left_planes[k]->data;
    input.right[k] = mirrored_[k].data;
  }
  input.left_step = static_cast<std::ptrdiff_t>(left_.slope.step);
  input.right_step = static_cast<std::ptrdiff_t>(mirrored_[0].step);
  input.phase_step = inside_.cols / (2 * vectors_ - 1);
  input.inside = inside_.data;
  input.beyond = beyond_.data();
  input.low_bytes = low_bytes_.data();
  input.high_bytes = high_bytes_.data();
  input.place = place_.data();
  input.p1 = static_cast<std::uint8_t>(parameters.p1);
  input.p2 = static_cast<std::uint8_t>(parameters.p2);
  input.aggregate_rows = parameters.aggregate_rows;
  input.ambiguous = ambiguous_.empty() ? nullptr : ambiguous_.data();

  sweep(input, threads);
  unchecked_.create(size, CV_16SC1);
  is_bad_.create(size, CV_8UC1);
  forEachStrip(threads, [&](int i) {
    Strip& strip = strips_[i];
    strip.costs.create(BLOCK_ROWS, states_.cols, CV_8UC1);
    strip.sums.create(BLOCK_ROWS, states_.cols, CV_8UC1);
    strip.winners.resize(size.width);
    strip.subpixel.resize(size.width);
    strip.is_ambiguous.resize(size.width);
    strip.right_winners.resize(size.width + input.disparities - 1);
    const cv::Range part = stripOf(blocks, i, threads);
    for (int block = part.start; block < part.end; ++block) {
      computeBlock(input, parameters, rowsOf(block, size.height), states_.ptr<std::uint8_t>(block), strip);
    }
  });
  cv::medianBlur(unchecked_, disparity, 3);
  for (int y = 0; y < size.height; ++y) {
    short* row = disparity.ptr<short>(y);
    const std::uint8_t* is_bad = is_bad_.ptr<std::uint8_t>(y);
    for (int x = 0; x < size.width; ++x) row[x] = is_bad[x] != 0 ? INVALID : row[x];
  }
}

}  // namespace disparity_refinement
