#include "disparity_refinement/segmentation/Watershed.hpp"

#include <algorithm>
#include <array>
#include <opencv2/core/hal/intrin.hpp>

#include "disparity_refinement/buffers.hpp"
#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {
namespace {

using cv::v_uint8x16;

// The neighbours in the order of ties that come later in raster order: E, S, SW, SE.
constexpr std::array<bool, 8> IS_LATER = {false, true, false, true, false, false, true, true};

// The code of a cell that points to neighbour i: less for what wins a tie, odd for what comes later.
constexpr std::uint8_t codeOf(int i) {
  return static_cast<std::uint8_t>(2 * (i + 1) + (IS_LATER[i] ? 1 : 0));
}
// Added to the codes of the wave that is under way: more than any code, and the sums are less than UNDECIDED.
constexpr std::uint8_t WAVE = 32;

}  // namespace

void Watershed::compute(const CellGrid& grid, const std::uint8_t* image, Connectivity connectivity, int count,
                        int strips, CellBuffers& buffers, cv::Mat& labels) {
  grid_ = grid;
  image_ = image;
  codes_ = buffers.codes.data();
  exit_levels_.resize(grid.capacity());
  std::int32_t* ids = buffers.ids.data();
  grid.fillFrame(ids, 0);
  connectivity == Connectivity::FOUR ? findDirections<4>(strips, buffers.scratch)
                                     : findDirections<8>(strips, buffers.scratch);

  PointerForest::Pointers pointers{};
  const std::array<int, 8> neighbours = grid.neighbours();
  for (int i = 0; i < 8; ++i) pointers.offset[codeOf(i)] = neighbours[i];
  pointers.node_mask = pointers.node_value = 1;
  buffers.forest.number(grid, codes_, pointers, count, strips, ids);
  // Nodes point forward, but for those where strips meet: these may stand for the frame.
  buffers.forest.resolve([](std::int32_t) { return 0; });

  const std::int32_t* label_of = buffers.forest.values().data();
  labels.create(grid.size(), CV_32SC1);
  forEachStrip(strips, [&](int i) {
    const cv::Range rows = stripOf(grid.rows(), i, strips);
    for (int y = rows.start; y < rows.end; ++y) {
      const std::int32_t* id = ids + grid.rowBegin(y);
      auto* label = labels.ptr<std::int32_t>(y);
      std::transform(id, id + grid.cols(), label, [label_of](std::int32_t i) { return label_of[i]; });
    }
  });
}

template <int neighbour_count>
void Watershed::findDirections(int strips, Scratch& scratch) {
  queue_begin_.resize(strips + 1);
  queue_begin_[0] = 0;
  forEachStrip(strips, [&](int i) {
    queue_begin_[i + 1] = pointToLowestNeighbours<neighbour_count>(grid_.strip(i, strips));
  });
  grid_.fillFrame(codes_, STAYS);
  grid_.fillFrame(exit_levels_.data(), std::uint8_t{0});

  for (int i = 0; i < strips; ++i) queue_begin_[i + 1] += queue_begin_[i];
  queue_ = scratch.array<std::int32_t>(queue_begin_[strips] + 1);
  queue_end_.resize(strips);
  forEachStrip(strips, [&](int i) {
    queue_end_[i] = pointToExits<neighbour_count>(grid_.strip(i, strips), queue_begin_[i]);
  });
  int end = queue_end_[0];
  for (int i = 1; i < strips; ++i) {
    for (int k = queue_begin_[i]; k < queue_end_[i]; ++k) queue_[end++] = queue_[k];
  }
  crossPlateaus<neighbour_count>(end);
}

// Returns the number of cells that stay undecided.
template <int neighbour_count>
int Watershed::pointToLowestNeighbours(cv::Range cells) {
  const std::array<int, 8> neighbours = grid_.neighbours();
  const v_uint8x16 zero = cv::v_setzero_u8(), one = cv::v_setall_u8(1);
  const v_uint8x16 undecided = cv::v_setall_u8(UNDECIDED);
  unsigned count = 0;
  for (int p = cells.start; p < cells.end; p += 16) {
    const v_uint8x16 value = cv::v_load(image_ + p);
    v_uint8x16 lowest = value, code = zero;
    for (int i = 0; i < neighbour_count; ++i) {
      const v_uint8x16 next = cv::v_min(lowest, cv::v_load(image_ + p + neighbours[i]));
      code = cv::v_select(next == lowest, code, cv::v_setall_u8(codeOf(i)));
      lowest = next;
    }
    const v_uint8x16 has_none = code == zero;
    code = cv::v_select(has_none, cv::v_load(codes_ + p), code);
    cv::v_store(codes_ + p, code);
    cv::v_store(&exit_levels_[p], value & ~has_none);
    count += cv::v_reduce_sum((code == undecided) & one);
  }
  return static_cast<int>(count);
}

// The pixels beside an exit of their plateau, a pixel with a lower neighbour. They go into the queue from
// `end` on; returns its new end.
template <int neighbour_count>
int Watershed::pointToExits(cv::Range cells, int end) {
  const std::array<int, 8> neighbours = grid_.neighbours();
  const v_uint8x16 undecided = cv::v_setall_u8(UNDECIDED);
  for (int p = cells.start; p < cells.end; p += 16) {
    const v_uint8x16 code = cv::v_load(codes_ + p);
    const v_uint8x16 is_undecided = code == undecided;
    if (cv::v_signmask(is_undecided) == 0) continue;
    const v_uint8x16 value = cv::v_load(image_ + p);
    // A plateau at level 0 is a minimum, so no level is mistaken for that of a cell that is no exit.
    v_uint8x16 found = undecided;
    for (int i = neighbour_count - 1; i >= 0; --i) {
      const v_uint8x16 is_exit = cv::v_load(&exit_levels_[p + neighbours[i]]) == value;
      found = cv::v_select(is_exit, cv::v_setall_u8(codeOf(i)), found);
    }
    cv::v_store(codes_ + p, cv::v_select(is_undecided, found, code));
    const v_uint8x16 is_found = is_undecided & ~(found == undecided);
    for (unsigned bits = static_cast<unsigned>(cv::v_signmask(is_found)); bits != 0; bits &= bits - 1) {
      queue_[end++] = p + __builtin_ctz(bits);
    }
  }
  return end;
}

// The plateaus are crossed from their exits inwards, in one wave for every distance. A pixel of the last wave
// claims all its neighbours that are undecided: they have no lower neighbour, so they are on its plateau. If
// several claim a pixel in one wave, the one that wins the tie has the smallest code.
//
// The loops have no branches that depend on the image, which a processor cannot predict.
template <int neighbour_count>
void Watershed::crossPlateaus(int end) {
  const std::array<int, 8> neighbours = grid_.neighbours();
  std::uint8_t* codes = codes_;
  std::int32_t* queue = queue_;
  for (int begin = 0; begin < end;) {
    const int wave_end = end;
    for (int k = begin; k < wave_end; ++k) {
      const std::int32_t claimer = queue[k];
      for (int i = 0; i < neighbour_count; ++i) {
        const std::int32_t pixel = claimer - neighbours[i];
        const std::uint8_t former = codes[pixel];
        codes[pixel] = std::min<std::uint8_t>(former, codeOf(i) + WAVE);
        queue[end] = pixel;
        end += static_cast<int>(former == UNDECIDED);
      }
    }
    for (int k = wave_end; k < end; ++k) codes[queue[k]] -= WAVE;
    begin = wave_end;
  }
}

}  // namespace disparity_refinement
