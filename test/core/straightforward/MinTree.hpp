#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "PaddedImage.hpp"
#include "disparity_refinement/segmentation/Connectivity.hpp"

namespace disparity_refinement {
namespace straightforward {

/// Min-tree of an 8-bit image: one node for every connected component of every lower level set {f <= t} in
/// which a pixel of value t lies; its parent is the next larger component that holds it.
///
/// The one tree serves both filters of the segmentation, in this order (they do not commute):
///
///   area closing  a(p)   = min { t : |CC_t(p)| >= lambda }, CC_t(p) the component of {f <= t} that holds p
///   H-minima      out(p) = reconstruction by erosion of a + h over a
///
/// and counts the regional minima that are left, for any lambda and h, without filtering an image.
///
/// Area closing keeps the nodes A of area >= lambda, and the root. Let m(A) be the smallest value of a inside
/// A and v(A) = max(level(A), m(A) + h). H-minima gives v(A) to the pixels of a kept node if v(A) <
/// level(parent(A)), else what its parent gives; the root gives v. A kept node makes a regional minimum of
/// out if level(A) <= m(A) + h < level(parent(A)); the level of the root's parent is infinite.
///
/// Values above 255 become 255. This changes no count: only v(root) can exceed 255, as every other value is
/// below level(parent(A)) <= 255, so no two flat zones become one.
class MinTree {
 public:
  struct Node {
    std::int32_t parent;  ///< Index of the parent; the root is its own parent.
    std::int32_t area;    ///< Number of pixels of the component [px].
    std::uint8_t level;   ///< Gray value t.
  };

  /// @param image  CV_8UC1, not empty; throws std::invalid_argument otherwise. Buffers of former images are
  /// reused.
  void build(const cv::Mat& image, Connectivity connectivity);

  /// Area closing, then H-minima. This and countSurface throw std::invalid_argument if a parameter is out of
  /// its range or no tree has been built.
  ///
  /// @param lambda    Smallest area of a component that stays [px], >= 0; 0 and 1 close nothing. Above the
  ///                  number of pixels only the root stays.
  /// @param h         Smallest depth of a minimum that stays [gray levels], 0...255; 0 fills nothing.
  /// @param filtered  CV_8UC1 of the image's size; written in place if it has that type and size already.
  void filter(int lambda, int h, cv::Mat& filtered) const;

  /// Number of regional minima of the image that filter(lambda, h) gives, for lambda = 0...max_lambda (rows)
  /// and h = 0...max_h (columns), CV_32SC1: the paper's Figure 5.
  cv::Mat countSurface(int max_lambda, int max_h) const;

 private:
  /// The pixels that the flood has reached but not entered: a stack for every gray level, linked through
  /// next_, and a bit for every level whose stack is not empty.
  class Front {
   public:
    static constexpr int LEVELS = 256;

    void reset(int cells);
    void push(int level, std::int32_t pixel);
    std::int32_t pop(int level);
    /// The lowest level >= from with a pixel, LEVELS if there is none.
    int lowest(int from) const;

   private:
    static constexpr std::int32_t BOTTOM = -1;
    static constexpr int WORD_BITS = 64;

    std::array<std::int32_t, LEVELS> top_;
    std::array<std::uint64_t, LEVELS / WORD_BITS> used_;
    std::vector<std::int32_t> next_;
  };

  /// A component that still grows.
  struct OpenComponent {
    std::int32_t id;  ///< Running number.
    std::int32_t area;
    int level;
  };

  template <int neighbour_count>
  void flood();
  void open(int level);
  /// Closes the components below a level, and opens one at that level unless there is one.
  void rise(int level);
  void close(const OpenComponent& component, std::int32_t parent_id);

  void requireTree() const;
  bool isRoot(std::size_t node) const { return node + 1 == nodes_.size(); }
  bool isKept(std::size_t node, int lambda) const { return nodes_[node].area >= lambda || isRoot(node); }
  /// level(parent(A)), infinite for the root.
  int parentLevel(std::size_t node) const;
  /// m(A) of every node that is kept; the level of the others.
  std::vector<std::uint8_t> lowestLevels(int lambda) const;

  PaddedImage image_;
  Front front_;
  std::vector<OpenComponent> open_;  ///< From the outermost to the innermost.
  std::vector<Node> nodes_;
  std::vector<std::int32_t> node_of_id_;
  std::vector<std::int32_t> node_of_cell_;  ///< The smallest component that holds a pixel.
};

}  // namespace straightforward
}  // namespace disparity_refinement
