#pragma once

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <stdexcept>
#include <string>

namespace disparity_refinement {

struct Outcome {
  int exit_code = 0;
  std::string text;  ///< What it wrote to stdout and stderr.
};

inline Outcome runCommand(const std::string& command) {
  std::FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) throw std::runtime_error("popen");
  Outcome outcome;
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), static_cast<int>(buffer.size()), pipe) != nullptr)
    outcome.text += buffer.data();
  const int status = pclose(pipe);
  outcome.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return outcome;
}

/// Runs a tool of this package, with settings of the environment such as "PATH=/bin".
inline Outcome run(const std::string& arguments, const std::string& environment = "") {
  return runCommand(environment + " " TOOLS_FOLDER "/" + arguments);
}

inline void expectGood(const std::string& arguments) {
  const Outcome outcome = run(arguments);
  EXPECT_EQ(outcome.exit_code, 0) << arguments << "\n" << outcome.text;
}

/// One line that begins with the tool's name and holds the words.
inline void expectError(const std::string& arguments, const std::string& words) {
  const Outcome outcome = run(arguments);
  EXPECT_EQ(outcome.exit_code, 1) << arguments;
  EXPECT_NE(outcome.text.find(words), std::string::npos) << arguments << "\n" << outcome.text;
  EXPECT_EQ(outcome.text.find(arguments.substr(0, arguments.find(' ')) + ": "), 0U) << outcome.text;
  EXPECT_EQ(outcome.text.find('\n'), outcome.text.size() - 1) << "one line: " << outcome.text;
}

}  // namespace disparity_refinement
