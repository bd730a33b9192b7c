#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <opencv2/core.hpp>

namespace disparity_refinement {

/// Where the pixels of an image lie in a linear array of cells with a frame around them: every pixel has all
/// its neighbours, and whole vectors of cells can be processed without a look at the borders.
///
/// The rows follow each other with one cell of the frame in between, which ends one row and begins the next.
/// A row of the frame stands above and below the image; behind it there is room for the last block.
class CellGrid {
 public:
  /// Cells processed together; begin() to end() and every strip are a multiple of it.
  static constexpr int BLOCK = 32;

  CellGrid() = default;
  /// Throws std::invalid_argument if the image is too large for 32-bit indices.
  explicit CellGrid(const cv::Size& size);

  bool operator==(const CellGrid& other) const { return rows_ == other.rows_ && cols_ == other.cols_; }
  bool operator!=(const CellGrid& other) const { return !(*this == other); }

  cv::Size size() const { return {cols_, rows_}; }
  int rows() const { return rows_; }
  int cols() const { return cols_; }
  /// Cells from a pixel to the one below it.
  int stride() const { return cols_ + 1; }

  /// The cell of the first pixel of a row.
  int rowBegin(int row) const { return begin() + row * stride(); }
  /// All pixels lie from begin() to end(), and cells of the frame among them.
  int begin() const { return stride() + 1; }
  int end() const { return begin() + blocks_ * BLOCK; }
  int blocks() const { return blocks_; }
  /// Strip i of n, which together hold the cells from begin() to end().
  cv::Range strip(int i, int n) const;

  /// Cells of the whole array.
  std::size_t capacity() const { return static_cast<std::size_t>(end()) + stride() + 1 + BLOCK; }

  /// What leads from a cell to its W, E, N, S, NW, NE, SW, SE neighbours. The first four are the neighbours
  /// of Connectivity::FOUR.
  std::array<int, 8> neighbours() const;

  /// Gives all cells of the frame a value.
  template <typename T>
  void fillFrame(T* cells, T value) const {
    const int last = rowBegin(rows_ - 1) + cols_;
    std::fill(cells, cells + begin(), value);
    for (int cell = begin() + cols_; cell < last; cell += stride()) cells[cell] = value;
    std::fill(cells + last, cells + capacity(), value);
  }

  /// The pixels of an array of cells as an image, without a copy.
  template <typename T>
  cv::Mat image(T* cells) const {
    return {rows_, cols_, cv::DataType<T>::type, cells + begin(), stride() * sizeof(T)};
  }

 private:
  int rows_ = 0, cols_ = 0, blocks_ = 0;
};

}  // namespace disparity_refinement
