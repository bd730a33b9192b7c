#include "MinTree.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/segmentation/BasinFilter.hpp"

namespace disparity_refinement {
namespace straightforward {

void MinTree::Front::reset(int cells) {
  top_.fill(BOTTOM);
  used_.fill(0);
  next_.resize(cells);
}

void MinTree::Front::push(int level, std::int32_t pixel) {
  next_[pixel] = top_[level];
  top_[level] = pixel;
  used_[level / WORD_BITS] |= std::uint64_t{1} << (level % WORD_BITS);
}

std::int32_t MinTree::Front::pop(int level) {
  const std::int32_t pixel = top_[level];
  top_[level] = next_[pixel];
  if (top_[level] == BOTTOM) used_[level / WORD_BITS] &= ~(std::uint64_t{1} << (level % WORD_BITS));
  return pixel;
}

int MinTree::Front::lowest(int from) const {
  const std::uint64_t rest = used_[from / WORD_BITS] >> (from % WORD_BITS);
  if (rest != 0) return from + __builtin_ctzll(rest);
  for (int i = from / WORD_BITS + 1; i < LEVELS / WORD_BITS; ++i) {
    if (used_[i] != 0) return WORD_BITS * i + __builtin_ctzll(used_[i]);
  }
  return LEVELS;
}

void MinTree::build(const cv::Mat& image, Connectivity connectivity) {
  validate(connectivity);
  image_.assign(image);
  front_.reset(image_.size());
  open_.clear();
  nodes_.clear();
  node_of_id_.clear();
  node_of_cell_.resize(image_.size());
  if (connectivity == Connectivity::FOUR) {
    flood<4>();
  } else {
    flood<8>();
  }

  // The flood knows a component by the number that it got when it was opened. Its node got an index when it
  // was closed, after everything inside it.
  for (Node& node : nodes_) node.parent = node_of_id_[node.parent];
  for (int y = 0; y < image_.rows(); ++y) {
    std::int32_t* row = &node_of_cell_[image_.rowBegin(y)];
    std::transform(row, row + image_.cols(), row, [this](std::int32_t id) { return node_of_id_[id]; });
  }
}

/// Water enters at one pixel, runs down at once into any lower pixel that it reaches, and rises to the next
/// level when a component is full (Salembier et al. 1998, Nister and Stewenius 2008). So the open components
/// are nested, and the front holds nothing below the water.
template <int neighbour_count>
void MinTree::flood() {
  // A cell that has been reached is no longer needed: it becomes a part of the frame.
  constexpr std::uint16_t REACHED = PaddedImage::FRAME;
  const std::array<int, 8> neighbours = image_.neighbours();
  std::uint16_t* cells = image_.cells();

  std::int32_t pixel = image_.rowBegin(0);
  int level = cells[pixel];
  cells[pixel] = REACHED;
  open(level);
  while (true) {
    std::int32_t lower = -1;
    for (int i = 0; i < neighbour_count; ++i) {
      const std::int32_t neighbour = pixel + neighbours[i];
      const int value = cells[neighbour];
      if (value == REACHED) continue;
      cells[neighbour] = REACHED;
      if (value < level) {
        // The pixel waits with its other neighbours until the water is back at its level.
        front_.push(level, pixel);
        lower = neighbour;
        level = value;
        break;
      }
      front_.push(value, neighbour);
    }
    if (lower >= 0) {
      pixel = lower;
      open(level);
      continue;
    }

    node_of_cell_[pixel] = open_.back().id;
    ++open_.back().area;

    const int next_level = front_.lowest(level);
    if (next_level == Front::LEVELS) break;
    pixel = front_.pop(next_level);
    rise(next_level);
    level = next_level;
  }
  close(open_.back(), open_.back().id);
}

void MinTree::open(int level) {
  open_.push_back({static_cast<std::int32_t>(node_of_id_.size()), 0, level});
  node_of_id_.push_back(-1);
}

void MinTree::rise(int level) {
  while (open_.back().level < level) {
    const OpenComponent child = open_.back();
    open_.pop_back();
    if (open_.empty() || open_.back().level > level) open(level);
    open_.back().area += child.area;
    close(child, open_.back().id);
  }
}

void MinTree::close(const OpenComponent& component, std::int32_t parent_id) {
  node_of_id_[component.id] = static_cast<std::int32_t>(nodes_.size());
  nodes_.push_back({parent_id, component.area, static_cast<std::uint8_t>(component.level)});
}

void MinTree::requireTree() const {
  requireArgument(!nodes_.empty(), "number of nodes", nodes_.size(), "build() before any use of the tree");
}

int MinTree::parentLevel(std::size_t node) const {
  return isRoot(node) ? std::numeric_limits<int>::max() : nodes_[nodes_[node].parent].level;
}

std::vector<std::uint8_t> MinTree::lowestLevels(int lambda) const {
  std::vector<std::uint8_t> lowest(nodes_.size());
  std::transform(nodes_.begin(), nodes_.end(), lowest.begin(), [](const Node& node) { return node.level; });
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    if (!isKept(i, lambda)) continue;
    std::uint8_t& of_parent = lowest[nodes_[i].parent];
    of_parent = std::min(of_parent, lowest[i]);
  }
  return lowest;
}

void MinTree::filter(int lambda, int h, cv::Mat& filtered) const {
  validateFilter(lambda, h);
  requireTree();

  // From the root down, a node's m gives way to the value that it gives to its pixels.
  std::vector<std::uint8_t> output = lowestLevels(lambda);
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    const int v = std::max<int>(nodes_[i].level, output[i] + h);
    const bool gives_v = isKept(i, lambda) && v < parentLevel(i);
    output[i] = gives_v ? cv::saturate_cast<std::uint8_t>(v) : output[nodes_[i].parent];
  }

  filtered.create(image_.rows(), image_.cols(), CV_8UC1);
  for (int y = 0; y < image_.rows(); ++y) {
    const std::int32_t* row = &node_of_cell_[image_.rowBegin(y)];
    std::transform(row, row + image_.cols(), filtered.ptr<std::uint8_t>(y),
                   [&output](std::int32_t node) { return output[node]; });
  }
}

cv::Mat MinTree::countSurface(int max_lambda, int max_h) const {
  requireArgument(max_lambda >= 0, "max_lambda", max_lambda, "at least 0");
  requireArgument(max_h >= 0 && max_h <= 255, "max_h", max_h, "0...255");
  requireTree();

  cv::Mat counts(max_lambda + 1, max_h + 1, CV_32SC1);
  std::vector<std::int32_t> kept(nodes_.size());
  std::iota(kept.begin(), kept.end(), 0);
  std::vector<std::uint8_t> lowest(nodes_.size());
  for (int lambda = 0; lambda <= max_lambda; ++lambda) {
    kept.erase(std::remove_if(kept.begin(), kept.end(), [&](std::int32_t i) { return !isKept(i, lambda); }),
               kept.end());
    for (const std::int32_t i : kept) lowest[i] = nodes_[i].level;

    // A node counts from h = level(A) - m(A) on, and no longer from h = level(parent(A)) - m(A) on.
    std::array<std::int32_t, 257> change{};
    for (const std::int32_t i : kept) {
      std::uint8_t& of_parent = lowest[nodes_[i].parent];
      of_parent = std::min(of_parent, lowest[i]);
      ++change[nodes_[i].level - lowest[i]];
      --change[std::min(parentLevel(i) - lowest[i], 256)];
    }
    std::partial_sum(change.begin(), change.begin() + max_h + 1, counts.ptr<std::int32_t>(lambda));
  }
  return counts;
}

}  // namespace straightforward
}  // namespace disparity_refinement
