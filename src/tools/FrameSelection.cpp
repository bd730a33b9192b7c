#include "FrameSelection.hpp"

#include <algorithm>
#include <cstdlib>
#include <sstream>

#include "disparity_refinement/arguments.hpp"

namespace disparity_refinement {
namespace {

constexpr const char* EXPECTED = "numbers and ranges such as 0,4,100-120";

int numberOf(const std::string& frame) { return std::atoi(frame.c_str()); }

int parseNumber(const std::string& text, const std::string& list) {
  const bool is_number =
      !text.empty() && text.size() < 9 && text.find_first_not_of("0123456789") == std::string::npos;
  requireArgument(is_number, "frames", list, EXPECTED);
  return std::stoi(text);
}

}  // namespace

FrameSelection::FrameSelection(const std::string& list) {
  std::istringstream stream(list);
  for (std::string part; std::getline(stream, part, ',');) {
    const auto dash = part.find('-');
    const int first = parseNumber(part.substr(0, dash), list);
    const int last = dash == std::string::npos ? first : parseNumber(part.substr(dash + 1), list);
    ranges_.push_back({first, last, part});
  }
  requireArgument(list.empty() || !ranges_.empty(), "frames", list, EXPECTED);
}

bool FrameSelection::Range::has(const std::string& frame) const {
  return numberOf(frame) >= first && numberOf(frame) <= last;
}

bool FrameSelection::has(const std::string& frame) const {
  return ranges_.empty() ||
         std::any_of(ranges_.begin(), ranges_.end(), [&](const Range& range) { return range.has(frame); });
}

void FrameSelection::requireFrames(const std::vector<std::string>& frames) const {
  for (const Range& range : ranges_) {
    const bool found =
        std::any_of(frames.begin(), frames.end(), [&](const auto& frame) { return range.has(frame); });
    requireArgument(found, "frames", range.text,
                    "numbers of frames, which are " + std::to_string(numberOf(frames.front())) + " ... " +
                        std::to_string(numberOf(frames.back())) + " here");
  }
}

}  // namespace disparity_refinement
