// Bags: the search for a stereo pair among any topics and types, and its images' stamps and frames. The bags
// themselves are whole, for rosbag reads them.

#include <ros/serialization.h>
#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <std_msgs/String.h>
#include <topic_tools/shape_shifter.h>

#include <string>
#include <vector>

#include "BagArguments.hpp"
#include "Input.hpp"
#include "KittiFixture.hpp"

namespace disparity_refinement {
namespace fuzz {
namespace {

// A topic that may be one of a stereo pair.
std::string topicOf(Input& input, const std::string& end) {
  if (input.oneIn(10)) return input.text(12) + "/" + end;
  return input.oneOf<std::string>(
             {"/stereo/", "/", "", "/kitti/camera_gray_", "/left/left_", "/a b/", "/\n/"}) +
         input.oneOf<std::string>({"left", "right"}) + "/" + end;
}

// A message whose bytes may end early.
topic_tools::ShapeShifter shifterOf(const sensor_msgs::Image& image, int cut) {
  std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(image));
  ros::serialization::OStream out(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(out, image);
  bytes.resize(std::max<std::size_t>(
      1, bytes.size() - std::min<std::size_t>(bytes.size(), static_cast<std::size_t>(cut))));
  topic_tools::ShapeShifter shifter;
  shifter.morph(ros::message_traits::md5sum(image), ros::message_traits::datatype(image),
                ros::message_traits::definition(image), "");
  ros::serialization::IStream in(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  shifter.read(in);
  return shifter;
}

void write(Input& input, rosbag::Bag& bag) {
  const ros::Time stamp(1 + input.bytes().ConsumeIntegral<std::uint16_t>(), 0);
  const std::string name =
      input.oneOf<std::string>({"image_rect", "image_rect", "image_rect_color", "image_raw"});
  switch (input.number(0, 4)) {
    case 0:
      bag.write(topicOf(input, name), stamp, std_msgs::String());
      return;
    case 1:
    case 2:
      bag.write(topicOf(input, "camera_info"), stamp, sensor_msgs::CameraInfo());
      return;
    default: {
      sensor_msgs::Image image;
      image.header.stamp.sec = input.oneIn(3) ? input.bytes().ConsumeIntegral<std::uint32_t>() : stamp.sec;
      image.header.stamp.nsec = static_cast<std::uint32_t>(input.number(0, 999999999));
      image.header.frame_id = input.oneIn(2) ? "stereo_left" : input.text(12);
      image.data.resize(static_cast<std::size_t>(input.number(0, 20)));
      bag.write(topicOf(input, name), stamp, shifterOf(image, input.oneIn(12) ? input.number(0, 60) : 0));
    }
  }
}

}  // namespace

void test(Input& input) {
  static const TemporaryFolder folder;
  // To make one takes a tenth of a second, and it grows with every file that it opens.
  // The last one is left: it would not survive the end of its library.
  static rosbag::Bag* used_bag = nullptr;
  static int uses = 0;
  if (uses++ % 512 == 0) {
    delete used_bag;
    used_bag = new rosbag::Bag;
  }
  rosbag::Bag& bag = *used_bag;
  const std::string file = (folder / "test.bag").string();
  bag.open(file, rosbag::bagmode::Write);
  if (!input.oneIn(4)) {
    for (const std::string side : {"left", "right"}) {
      bag.write("/stereo/" + side + "/camera_info", ros::Time(1), sensor_msgs::CameraInfo());
      bag.write("/stereo/" + side + "/image_rect", ros::Time(1), sensor_msgs::Image());
    }
  }
  for (int i = input.number(0, 10); i > 0; --i) write(input, bag);
  bag.close();
  bag.open(file, rosbag::bagmode::Read);
  std::vector<std::string> arguments;
  const bool is_good = succeeds<std::runtime_error>([&] { arguments = bagArguments(bag); });
  bag.close();
  if (!is_good) return;
  require(arguments.size() == 5 || arguments.size() == 7, "there are five arguments, or two more");
  for (const std::string& argument : arguments) {
    require(argument.find(":=") != std::string::npos &&
                argument.find_first_of(std::string("\n\r\0", 3)) == std::string::npos,
            "an argument is one line");
  }
}

}  // namespace fuzz
}  // namespace disparity_refinement
