#pragma once

#include <boost/program_options.hpp>
#include <functional>
#include <string>
#include <vector>

namespace disparity_refinement {

/// Runs a command-line tool. An exception becomes the one line "<tool>: <message>" on stderr.
///
/// @return  The exit code: 0, or 1 after an exception.
int runTool(const std::string& tool, const std::function<void()>& body);

/// Reads `positional` arguments, all of them required, and options into `values`; adds --help, which prints
/// the usage.
///
/// @return  Whether there is something to do: false after --help.
/// Throws std::exception if an argument is missing, unknown or has a bad value.
bool parseCommandLine(int argc, const char* const* argv, const std::string& usage,
                      const std::vector<std::string>& positional,
                      boost::program_options::options_description options,
                      boost::program_options::variables_map& values);

/// A progress bar on stderr, if that is a terminal.
class ProgressLine {
 public:
  ProgressLine();
  ~ProgressLine();
  ProgressLine(const ProgressLine&) = delete;
  ProgressLine& operator=(const ProgressLine&) = delete;

  void show(int done, int total);

 private:
  bool is_terminal_;
  bool is_shown_ = false;
};

}  // namespace disparity_refinement
