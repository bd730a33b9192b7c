#pragma once

#include <iosfwd>
#include <string>

#include "Evaluation.hpp"

namespace disparity_refinement {

/// Tables for people: for each kind of ground truth the rates [%] and end-point errors [px] of every method,
/// then the segments and times, errors by source and confidence if they were counted, then what was left out.
void printTables(const Evaluation& evaluation, std::ostream& out);

/// An array of one object a method: name, frames (their number), parameters, segments, ms {matching,
/// segmentation, refinement, total}, and for every kind of ground truth density, all and est {"1" ... "5",
/// "epe"}; rates in percent, end-point errors in px. If it was counted, confidence has {share, wrong} [%] for
/// every source and range of confidence. What a method does not have is null (segments and ms of
/// finished maps, segments of a matcher). Throws std::runtime_error that names the file.
void writeJson(const Evaluation& evaluation, const std::string& file);

/// One line for every method, kind of ground truth and frame, and one with the frame "mean". Throws
/// std::runtime_error that names the file.
void writeCsv(const Evaluation& evaluation, const std::string& file);

}  // namespace disparity_refinement
