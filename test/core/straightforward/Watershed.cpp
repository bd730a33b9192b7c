#include "Watershed.hpp"

#include <array>

namespace disparity_refinement {
namespace straightforward {

int Watershed::compute(const cv::Mat& image, Connectivity connectivity, cv::Mat& labels) {
  validate(connectivity);
  image_.assign(image);
  target_.assign(image_.size(), OUTSIDE);
  queue_.resize(image_.size());
  const int count = connectivity == Connectivity::FOUR ? findTargets<4>() : findTargets<8>();

  labels.create(image_.rows(), image_.cols(), CV_32SC1);
  for (int y = 0; y < image_.rows(); ++y) {
    const std::int32_t begin = image_.rowBegin(y);
    auto* row = labels.ptr<std::int32_t>(y);
    for (int x = 0; x < image_.cols(); ++x) row[x] = followPath(begin + x);
  }
  return count;
}

template <int neighbour_count>
int Watershed::findTargets() {
  pointToLowestNeighbours<neighbour_count>();
  pointAcrossPlateaus<neighbour_count>();
  return labelMinima<neighbour_count>();
}

template <int neighbour_count>
void Watershed::pointToLowestNeighbours() {
  const std::array<int, 8> neighbours = image_.neighbours();
  const std::uint16_t* cells = image_.cells();
  for (int y = 0; y < image_.rows(); ++y) {
    const std::int32_t begin = image_.rowBegin(y);
    for (std::int32_t pixel = begin; pixel < begin + image_.cols(); ++pixel) {
      std::uint16_t lowest = cells[pixel];
      std::int32_t target = NONE;
      for (int i = 0; i < neighbour_count; ++i) {
        const std::int32_t neighbour = pixel + neighbours[i];
        const bool lower = cells[neighbour] < lowest;
        lowest = lower ? cells[neighbour] : lowest;
        target = lower ? neighbour : target;
      }
      target_[pixel] = target;
    }
  }
}

/// The plateaus are crossed from their exits inwards. A pixel takes over the target of the pixel that it
/// points to: the end of the path is the same, and every step of a path goes down.
///
/// The loops avoid branches that depend on the image, which a processor cannot predict.
template <int neighbour_count>
void Watershed::pointAcrossPlateaus() {
  const std::array<int, 8> neighbours = image_.neighbours();
  const std::uint16_t* cells = image_.cells();
  std::int32_t* target = target_.data();
  std::int32_t* queue = queue_.data();
  int end = 0;

  // The pixels beside an exit, a pixel of the plateau that has a lower neighbour. Their targets stay negative
  // until all of them are found, so that none is taken for an exit itself.
  for (int y = 0; y < image_.rows(); ++y) {
    const std::int32_t begin = image_.rowBegin(y);
    for (std::int32_t pixel = begin; pixel < begin + image_.cols(); ++pixel) {
      if (target[pixel] != NONE) continue;
      unsigned exits = 0;
      for (int i = 0; i < neighbour_count; ++i) {
        const std::int32_t neighbour = pixel + neighbours[i];
        const bool is_exit = (cells[neighbour] == cells[pixel]) & (target[neighbour] > NONE);
        exits |= static_cast<unsigned>(is_exit) << i;
      }
      if (exits == 0) continue;
      const int first = __builtin_ctz(exits);
      target[pixel] = -target[pixel + neighbours[first]];
      queue[end++] = pixel;
    }
  }
  for (int k = 0; k < end; ++k) target[queue[k]] = -target[queue[k]];

  // One wave for every distance. Two neighbours are equal if neither has a lower neighbour, so that values
  // need not be compared. The direction is the outer loop: of the pixels that claim a pixel in one wave, the
  // first in the order of ties comes first.
  for (int wave_begin = 0; wave_begin < end;) {
    const int wave_end = end;
    for (int i = 0; i < neighbour_count; ++i) {
      for (int k = wave_begin; k < wave_end; ++k) {
        const std::int32_t pixel = queue[k] - neighbours[i];
        const bool claimed = target[pixel] == NONE;
        target[pixel] = claimed ? target[queue[k]] : target[pixel];
        queue[end] = pixel;
        end += static_cast<int>(claimed);
      }
    }
    wave_begin = wave_end;
  }
}

/// The flat zones that point nowhere are the regional minima.
template <int neighbour_count>
int Watershed::labelMinima() {
  const std::array<int, 8> neighbours = image_.neighbours();
  std::int32_t* target = target_.data();
  std::int32_t* stack = queue_.data();
  int count = 0;
  for (int y = 0; y < image_.rows(); ++y) {
    const std::int32_t begin = image_.rowBegin(y);
    for (std::int32_t seed = begin; seed < begin + image_.cols(); ++seed) {
      if (target[seed] != NONE) continue;
      const std::int32_t label = ~count;
      ++count;
      target[seed] = label;
      int size = 0;
      stack[size++] = seed;
      while (size > 0) {
        const std::int32_t pixel = stack[--size];
        for (int i = 0; i < neighbour_count; ++i) {
          const std::int32_t neighbour = pixel + neighbours[i];
          const bool joins = target[neighbour] == NONE;
          target[neighbour] = joins ? label : target[neighbour];
          stack[size] = neighbour;
          size += static_cast<int>(joins);
        }
      }
    }
  }
  return count;
}

std::int32_t Watershed::followPath(std::int32_t pixel) {
  std::int32_t end = pixel;
  while (target_[end] >= 0) end = target_[end];
  const std::int32_t label = target_[end];
  while (pixel != end) {
    const std::int32_t next = target_[pixel];
    target_[pixel] = label;
    pixel = next;
  }
  return ~label;
}

}  // namespace straightforward
}  // namespace disparity_refinement
