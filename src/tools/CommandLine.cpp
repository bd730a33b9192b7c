#include "CommandLine.hpp"

#include <unistd.h>

#include <cstdio>
#include <exception>
#include <iostream>
#include <stdexcept>

namespace disparity_refinement {

namespace po = boost::program_options;

int runTool(const std::string& tool, const std::function<void()>& body) {
  try {
    body();
    return 0;
  } catch (const std::exception& error) {
    std::cerr << tool << ": " << error.what() << "\n";
    return 1;
  }
}

bool parseCommandLine(int argc, const char* const* argv, const std::string& usage,
                      const std::vector<std::string>& positional, po::options_description options,
                      po::variables_map& values) {
  options.add_options()("help,h", "print this text");
  po::options_description all;
  all.add(options);
  po::positional_options_description positions;
  for (const std::string& name : positional) {
    all.add_options()(name.c_str(), po::value<std::string>());
    positions.add(name.c_str(), 1);
  }
  po::store(po::command_line_parser(argc, argv).options(all).positional(positions).run(), values);
  if (values.count("help") != 0) {
    std::cout << usage << "\n" << options;
    return false;
  }
  for (const std::string& name : positional) {
    if (values.count(name) == 0) throw std::invalid_argument("expected " + name + ", see --help");
  }
  po::notify(values);
  return true;
}

ProgressLine::ProgressLine() : is_terminal_(isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() {
  if (is_shown_) std::fputc('\n', stderr);
}

void ProgressLine::show(int done, int total) {
  if (!is_terminal_) return;
  constexpr int WIDTH = 40;
  const int filled = total > 0 ? static_cast<int>(static_cast<long long>(WIDTH) * done / total) : WIDTH;
  const std::string bar = std::string(static_cast<std::size_t>(filled), '#') +
                          std::string(static_cast<std::size_t>(WIDTH - filled), '.');
  std::fprintf(stderr, "\r[%s] %d of %d frames", bar.c_str(), done, total);
  is_shown_ = true;
}

}  // namespace disparity_refinement
