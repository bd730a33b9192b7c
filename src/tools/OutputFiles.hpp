#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace disparity_refinement {

// All of these throw std::runtime_error "cannot write <file>".

/// The bytes as they are.
void writeTextFile(const std::string& file, const std::string& text);

/// In the format that the ending of the file's name says.
void writeImageFile(const std::string& file, const cv::Mat& image);

/// Tells before a long run what would fail after it. Makes the file if there is none.
void requireWritable(const std::string& file);

}  // namespace disparity_refinement
