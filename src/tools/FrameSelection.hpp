#pragma once

#include <string>
#include <vector>

namespace disparity_refinement {

/// Frames by a list of numbers and ranges such as "0,4,100-120"; all for an empty list.
class FrameSelection {
 public:
  /// Throws std::invalid_argument unless it is such a list.
  explicit FrameSelection(const std::string& list);

  /// @param frame  Name of a frame: it begins with its number.
  bool has(const std::string& frame) const;

  /// Throws std::invalid_argument unless every part of the list is the number of a frame.
  /// @param frames  By rising number, at least one.
  void requireFrames(const std::vector<std::string>& frames) const;

 private:
  struct Range {
    int first, last;
    std::string text;

    bool has(const std::string& frame) const;
  };

  std::vector<Range> ranges_;
};

}  // namespace disparity_refinement
