#include "OpenBag.hpp"

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <system_error>

namespace disparity_refinement {

void openBag(const std::string& file, rosbag::Bag& bag) {
  std::error_code error_code;
  if (std::filesystem::is_directory(file, error_code))
    throw std::runtime_error(file + " is a folder, expected a bag");
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw std::runtime_error("cannot open " + file + ", expected a bag");
  const std::string beginning = "#ROSBAG V";
  std::string found(beginning.size(), '\0');
  if (!stream.read(&found[0], static_cast<std::streamsize>(found.size())) || found != beginning) {
    throw std::runtime_error(file + " is no bag, expected a file that begins with " + beginning);
  }
  try {
    bag.open(file);
  } catch (const std::exception& error) {
    throw std::runtime_error(file + " is not complete: " + error.what() +
                             "; expected a bag with its index, \"rosbag reindex " + file +
                             "\" makes one of what is left");
  }
}

}  // namespace disparity_refinement
