#pragma once

#include <opencv2/core.hpp>
#include <vector>

namespace disparity_refinement {

/// Neighbouring segments and the borders between them. Pixels beside or above each other are neighbours.
///
/// Buffers are kept between frames.
class SegmentGraph {
 public:
  /// A place on a border, in the middle between two pixels [px]. Its weight is 1 where the two have the same
  /// gray value, and falls with their contrast: depth steps show in the image.
  struct BorderPoint {
    float x, y, weight;
  };

  /// The border to another segment.
  struct Border {
    int neighbour;
    int first_point, end_point;  ///< Its points in raster order: point(first_point) ... point(end_point - 1).

    int length() const { return end_point - first_point; }
    /// Distance of the points that are enough to look at: 16 or more of a long border, all of a short one.
    int stride() const { return length() < 32 ? 1 : length() / 16; }
  };

  class Borders {
   public:
    Borders(const Border* begin, const Border* end) : begin_(begin), end_(end) {}
    const Border* begin() const { return begin_; }
    const Border* end() const { return end_; }

   private:
    const Border *begin_, *end_;
  };

  /// @param labels         CV_32SC1, 0 ... segments - 1; negative labels belong to no segment.
  /// @param gray           CV_8UC1 of the same size.
  /// @param half_contrast  Difference of gray values at which the weight is 1/2, > 0.
  void build(const cv::Mat& labels, const cv::Mat& gray, int segments, double half_contrast);

  /// The borders of a segment in the order of the neighbours' labels.
  Borders bordersOf(int segment) const {
    return {borders_.data() + first_border_[segment], borders_.data() + first_border_[segment + 1]};
  }
  const BorderPoint& point(int i) const { return points_[i]; }

 private:
  struct Contact {
    int low, high;  // Labels.
    BorderPoint point;
  };

  void findContacts(const cv::Mat& labels, const cv::Mat& gray, double half_contrast);
  void sortContacts(int segments);

  std::vector<Contact> contacts_, sorted_;
  std::vector<int> counts_;
  std::vector<BorderPoint> points_;
  std::vector<int> first_border_;
  std::vector<Border> borders_;
};

}  // namespace disparity_refinement
