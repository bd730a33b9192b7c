// Bags that are none, or not whole: one error that names the file, from the tools and from kitti.launch.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "KittiFixture.hpp"
#include "RunTool.hpp"

namespace disparity_refinement {
namespace {

namespace fs = std::filesystem;

/// A bag of the street, and the same cut off.
class BagFault : public testing::Test {
 protected:
  static constexpr std::size_t HEADER = 4117;  ///< Of a bag: the line of its version and one record of 4 kB.

  BagFault() {
    expectGood("render_street " + bag + " --frames 12 --width 320 --height 120");
    std::ifstream stream(bag, std::ios::binary);
    data = {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    std::uint64_t position = 0;
    std::memcpy(&position, data.data() + indexField(), sizeof(position));
    index = position;
  }

  std::string out(const std::string& name) const { return (folder / name).string(); }

  /// Where its header says where the index begins.
  std::size_t indexField() const { return data.find("index_pos=") + std::strlen("index_pos="); }

  std::string write(const std::string& name, const std::string& content) const {
    std::ofstream(folder / name, std::ios::binary) << content;
    return out(name);
  }

  std::string cut(std::size_t size) const { return write("cut.bag", data.substr(0, size)); }

  /// As a recorder leaves it that was killed: the header is written anew when the bag is closed.
  std::string unindexed() const {
    std::string content = data.substr(0, HEADER + 2 * (index - HEADER) / 3);
    content.replace(indexField(), 8, 8, '\0');
    return write("unindexed.bag", content);
  }

  const TemporaryFolder folder;
  const std::string bag = out("street.bag");
  std::string data;
  std::size_t index = 0;
};

TEST_F(BagFault, ofACutIsReportedWhereverItIs) {
  ASSERT_GT(index, HEADER);
  ASSERT_GT(data.size(), index);
  std::vector<std::size_t> sizes = {HEADER, index, data.size() - 1};
  constexpr std::size_t CUTS = 4;
  for (std::size_t i = 1; i < CUTS; ++i) {
    sizes.push_back(13 + i * (HEADER - 13) / CUTS);             // in the header
    sizes.push_back(HEADER + i * (index - HEADER) / CUTS);      // in a chunk
    sizes.push_back(index + i * (data.size() - index) / CUTS);  // in the index
  }
  for (const std::size_t size : sizes) {
    SCOPED_TRACE(size);
    const std::string file = cut(size);
    const std::string words = file + " is not complete: ";
    expectError("bag_arguments " + file, words);
    expectError("check_bag " + file, "; expected a bag with its index, \"rosbag reindex " + file + "\"");
  }
  expectError("bag_arguments " + unindexed(), unindexed() + " is not complete: Bag unindexed; expected");
}

TEST_F(BagFault, ofAFileThatIsNoBagIsReported) {
  const std::vector<std::string> files = {write("empty.bag", ""), write("text.bag", "This is a text.\n"),
                                          cut(5)};
  for (const std::string& file : files) {
    for (const std::string tool : {"bag_arguments ", "check_bag "})
      expectError(tool + file, file + " is no bag, expected a file that begins with #ROSBAG V");
  }
  for (const std::string tool : {"bag_arguments ", "check_bag "}) {
    expectError(tool + out("none.bag"), "cannot open " + out("none.bag") + ", expected a bag");
    expectError(tool + folder.string(), folder.string() + " is a folder, expected a bag");
  }
}

TEST_F(BagFault, ofOtherTopicsIsReported) {
  expectGood("check_bag " + bag);
  expectGood("check_bag " + bag + " --topic /no/topic --topic /stereo/left/image_rect");
  expectError("check_bag " + bag + " --topic /a/left/image --topic /a/right/image",
              bag + " has no message, expected some on /a/left/image, /a/right/image");
  expectError("check_bag street.bag", "\"street.bag\" is relative, expected a full path");
}

TEST_F(BagFault, isMendedByReindex) {
  const std::string files[] = {cut(HEADER + (index - HEADER) / 2), unindexed()};
  for (const std::string& file : files) {
    const Outcome reindex = runCommand("rosbag reindex " + file);
    ASSERT_EQ(reindex.exit_code, 0) << reindex.text;
    expectGood("check_bag " + file + " --topic /stereo/left/image_rect");
    const Outcome arguments = run("bag_arguments " + file);
    EXPECT_EQ(arguments.exit_code, 0);
    EXPECT_NE(arguments.text.find("left:=/stereo/left\n"), std::string::npos) << arguments.text;
  }
}

TEST_F(BagFault, endsTheLaunchBeforeItStarts) {
  const struct {
    std::string arguments, error;
  } LAUNCHES[] = {
      {"bag:=" + cut(index / 2), out("cut.bag") + " is not complete: "},
      {"bag:=" + bag + " namespace:=elsewhere report:=" + out("report"),
       bag + " has no message, expected some on /elsewhere/left/image_rect"},
  };
  for (const auto& launch : LAUNCHES) {
    const Outcome outcome =
        runCommand("timeout 60 roslaunch disparity_refinement kitti.launch " + launch.arguments);
    EXPECT_EQ(outcome.exit_code, 1) << outcome.text;
    EXPECT_NE(outcome.text.find("check_bag: " + launch.error), std::string::npos) << outcome.text;
    EXPECT_EQ(outcome.text.find("process["), std::string::npos) << "nodes have started:\n" << outcome.text;
  }
}

}  // namespace
}  // namespace disparity_refinement
