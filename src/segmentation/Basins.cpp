#include "disparity_refinement/segmentation/Basins.hpp"

#include <algorithm>
#include <opencv2/core/hal/intrin.hpp>
#include <utility>

#include "disparity_refinement/buffers.hpp"
#include "disparity_refinement/strips.hpp"

namespace disparity_refinement {
namespace {

// The neighbours in the order of CellGrid::neighbours(). Bit i of a cell's code says that neighbour i is
// lower. W, N, NW and NE come earlier in raster order.
enum Neighbour { W, E, N, S, NW, NE, SW, SE };
constexpr std::array<int, 8> RING = {W, NW, N, NE, E, SE, S, SW};

constexpr std::uint8_t bitOf(int neighbour) { return static_cast<std::uint8_t>(1 << neighbour); }

// What the set of a pixel's lower neighbours says.
struct LowerSet {
  int target = -1;               // The neighbour that the pixel points to, -1 if there is none.
  int parts = 0;                 // Parts that hang together in the ring.
  std::array<int, 4> members{};  // A neighbour of each part.
};

LowerSet describe(unsigned lower, Connectivity connectivity) {
  const bool eight = connectivity == Connectivity::EIGHT;
  const auto isLower = [lower](int neighbour) { return (lower >> neighbour & 1) != 0; };
  const auto isNeighbour = [eight](int neighbour) { return eight || neighbour < 4; };
  LowerSet set;
  // Pointers back cost less than pointers forward, and to the row above less than to the cell just written.
  for (const int neighbour : {N, NW, NE, W, S, SW, SE, E}) {
    if (set.target < 0 && isLower(neighbour) && isNeighbour(neighbour)) set.target = neighbour;
  }

  // Parts grow along the ring until nothing changes.
  std::array<int, 8> part;
  for (int k = 0; k < 8; ++k) part[k] = k;
  const auto unite = [&](int k, int l) {
    if (isLower(RING[k]) && isLower(RING[l])) part[k] = part[l] = std::min(part[k], part[l]);
  };
  for (int round = 0; round < 8; ++round) {
    for (int k = 0; k < 8; ++k) {
      unite(k, (k + 1) % 8);
      // With eight neighbours two sides touch across the corner between them.
      if (eight && k % 2 == 0) unite(k, (k + 2) % 8);
    }
  }
  std::array<bool, 8> seen{};
  for (int k = 0; k < 8; ++k) {
    if (!isLower(RING[k]) || !isNeighbour(RING[k]) || seen[part[k]]) continue;
    seen[part[k]] = true;
    set.members[set.parts++] = RING[k];
  }
  return set;
}

using LowerSets = std::array<LowerSet, 256>;

const LowerSets& lowerSets(Connectivity connectivity) {
  const auto describeAll = [](Connectivity c) {
    LowerSets sets;
    for (unsigned lower = 0; lower < sets.size(); ++lower) sets[lower] = describe(lower, c);
    return sets;
  };
  static const LowerSets four = describeAll(Connectivity::FOUR), eight = describeAll(Connectivity::EIGHT);
  return connectivity == Connectivity::FOUR ? four : eight;
}

}  // namespace

void Basins::build(const CellGrid& grid, const std::uint8_t* image, Connectivity connectivity, int strips,
                   CellBuffers& buffers) {
  validate(connectivity);
  grid_ = grid;
  image_ = image;
  connectivity_ = connectivity;
  strips_.resize(strips);
  for (int i = 0; i < strips; ++i) strips_[i].cells = grid.strip(i, strips);
  // Of the same size for all images of a size: no room for more is needed.
  critical_.resize(grid.blocks());
  buffers.codes.resize(grid.capacity());
  buffers.ids.resize(grid.capacity());

  const bool four = connectivity == Connectivity::FOUR;
  std::uint8_t* lower = buffers.codes.data();
  forEachStrip(strips, [&](int i) {
    four ? findLowerNeighbours<4>(strips_[i].cells, lower) : findLowerNeighbours<8>(strips_[i].cells, lower);
    countPixels(strips_[i]);
  });

  const std::array<int, 8> neighbours = grid.neighbours();
  PointerForest::Pointers pointers;
  for (int code = 0; code < LEVELS; ++code) {
    const int target = lowerSets(connectivity)[code].target;
    pointers.offset[code] = target < 0 ? 0 : neighbours[target];
  }
  // A cell makes a node if no earlier neighbour is lower.
  pointers.node_mask = bitOf(W) | bitOf(N);
  if (!four) pointers.node_mask |= bitOf(NW) | bitOf(NE);
  pointers.node_value = 0;
  lower[0] = 0;
  buffers.forest.number(grid, lower, pointers, 0, strips, buffers.ids.data());
  start_count_ = buffers.forest.size();
  growTo(starts_, start_count_);
  for (int i = 0; i < start_count_; ++i) starts_[i] = buffers.forest.cellOf(i);
  size_ = SUMMIT + 1;
  buffers.forest.resolve([&](std::int32_t cell) { return image[cell] == SUMMIT_LEVEL ? SUMMIT : size_++; });

  layOutLevels([](Strip& strip) { return std::array{&strip.even_pixels, &strip.odd_pixels}; }, pixel_begin_);
  const int pixel_count = pixel_begin_.back();
  auto* small_pixels = isSmall() ? buffers.scratch.array<std::uint16_t>(pixel_count) : nullptr;
  auto* pixels = isSmall() ? nullptr : buffers.scratch.array<std::int32_t>(pixel_count);
  forEachStrip(strips, [&](int i) {
    const std::int32_t* basin_of_node = buffers.forest.values().data();
    std::int32_t* ids = buffers.ids.data();
    isSmall() ? sortPixels(strips_[i], basin_of_node, ids, small_pixels)
              : sortPixels(strips_[i], basin_of_node, ids, pixels);
  });

  // To look twice takes less memory than to keep what was seen.
  forEachStrip(strips, [&](int i) {
    Histogram& counts = strips_[i].saddles;
    counts.fill(0);
    visitSaddles(strips_[i], buffers, [&counts](int level, const Saddle&) { ++counts[level]; });
  });
  layOutLevels([](Strip& strip) { return std::array{&strip.saddles}; }, saddle_begin_);
  growTo(saddles_, saddle_begin_.back());
  forEachStrip(strips, [&](int i) {
    Histogram& next = strips_[i].saddles;
    visitSaddles(strips_[i], buffers,
                 [&](int level, const Saddle& saddle) { saddles_[next[level]++] = saddle; });
  });
}

template <int neighbour_count>
void Basins::findLowerNeighbours(cv::Range cells, std::uint8_t* lower) {
  using cv::v_uint8x16;
  const int stride = grid_.stride();
  const v_uint8x16 zero = cv::v_setzero_u8();
  const v_uint8x16 summit = cv::v_setall_u8(SUMMIT_LEVEL);
  const v_uint8x16 below_summit = cv::v_setall_u8(SUMMIT_LEVEL - 1);
  const auto bit = [](Neighbour i) { return cv::v_setall_u8(bitOf(i)); };
  const v_uint8x16 later_bits = bit(E) | bit(S) | bit(SW) | bit(SE);
  for (int block = cells.start; block < cells.end; block += CellGrid::BLOCK) {
    std::uint32_t critical = 0;
    for (int i = 0; i < CellGrid::BLOCK; i += 16) {
      const std::uint8_t* p = image_ + block + i;
      const v_uint8x16 value = cv::v_load(p);
      // An earlier neighbour is lower if it is not higher. At the summit none is lower: the frame has its
      // level.
      const v_uint8x16 limit = cv::v_min(value, below_summit);
      const auto earlier = [&](int offset) { return cv::v_load(p + offset) - limit == zero; };
      const auto laterIsNot = [&](int offset) { return value - cv::v_load(p + offset) == zero; };
      const v_uint8x16 w = earlier(-1), n = earlier(-stride), nw = earlier(-stride - 1),
                       ne = earlier(-stride + 1);
      const v_uint8x16 not_e = laterIsNot(1), not_s = laterIsNot(stride), not_sw = laterIsNot(stride - 1),
                       not_se = laterIsNot(stride + 1);
      const v_uint8x16 earlier_lower = (w & bit(W)) | (n & bit(N)) | (nw & bit(NW)) | (ne & bit(NE));
      const v_uint8x16 later_not_lower =
          (not_e & bit(E)) | (not_s & bit(S)) | (not_sw & bit(SW)) | (not_se & bit(SE));
      cv::v_store(lower + block + i, earlier_lower | (later_not_lower ^ later_bits));

      // Yokoi's number is the sum of these four; the pixel is critical if it is 2 or more.
      v_uint8x16 a, b, c, d;
      if (neighbour_count == 8) {
        a = not_e & (ne | n);
        b = ~n & (nw | w);
        c = ~w & ~(not_sw & not_s);
        d = not_s & ~(not_se & not_e);
      } else {
        a = ~not_e & ~(ne & n);
        b = n & ~(nw & w);
        c = w & (not_sw | not_s);
        d = ~not_s & (not_se | not_e);
      }
      const v_uint8x16 two = (a & b) | ((a | b) & (c | d)) | (c & d);
      critical |= static_cast<std::uint32_t>(cv::v_signmask(two & ~(value == summit))) << i;
    }
    critical_[(block - grid_.begin()) / CellGrid::BLOCK] = critical;
  }
}

void Basins::countPixels(Strip& strip) {
  strip.even_pixels.fill(0);
  strip.odd_pixels.fill(0);
  const std::uint8_t* image = image_;
  std::int32_t *even = strip.even_pixels.data(), *odd = strip.odd_pixels.data();
  for (int p = strip.cells.start, end = strip.cells.end; p < end; p += 2) {
    ++even[image[p]];
    ++odd[image[p + 1]];
  }
}

template <typename CountsOf>
void Basins::layOutLevels(const CountsOf& counts_of, LevelBegins& begins) {
  int begin = 0;
  for (int level = 0; level < LEVELS; ++level) {
    begins[level] = begin;
    for (Strip& strip : strips_) {
      for (Histogram* counts : counts_of(strip)) begin += std::exchange((*counts)[level], begin);
    }
  }
  begins[LEVELS] = begin;
}

template <typename Index>
void Basins::sortPixels(Strip& strip, const std::int32_t* basin_of_node, std::int32_t* ids, Index* pixels) {
  const std::uint8_t* image = image_;
  std::int32_t *even = strip.even_pixels.data(), *odd = strip.odd_pixels.data();
  for (int p = strip.cells.start, end = strip.cells.end; p < end; p += 2) {
    const std::int32_t a = basin_of_node[ids[p]], b = basin_of_node[ids[p + 1]];
    ids[p] = a;
    ids[p + 1] = b;
    pixels[even[image[p]]++] = static_cast<Index>(a);
    pixels[odd[image[p + 1]]++] = static_cast<Index>(b);
  }
}

template <typename Visitor>
void Basins::visitSaddles(const Strip& strip, const CellBuffers& buffers, const Visitor& visit) const {
  const LowerSets& lower_sets = lowerSets(connectivity_);
  const std::array<int, 8> neighbours = grid_.neighbours();
  const std::uint8_t* lower = buffers.codes.data();
  const std::int32_t* basin_of = buffers.ids.data();
  for (int block = strip.cells.start; block < strip.cells.end; block += CellGrid::BLOCK) {
    std::uint32_t critical = critical_[(block - grid_.begin()) / CellGrid::BLOCK];
    for (; critical != 0; critical &= critical - 1) {
      const int p = block + __builtin_ctz(critical);
      const LowerSet& set = lower_sets[lower[p]];
      const std::int32_t a = basin_of[p + neighbours[set.members[0]]];
      for (int i = 1; i < set.parts; ++i) {
        const std::int32_t b = basin_of[p + neighbours[set.members[i]]];
        if (a != b) visit(image_[p], Saddle{a, b});
      }
    }
  }
}

}  // namespace disparity_refinement
