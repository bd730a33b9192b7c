#include <gtest/gtest.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <stereo_msgs/DisparityImage.h>
#include <sys/resource.h>

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "KittiFixture.hpp"
#include "KittiToBag.hpp"

namespace disparity_refinement {
namespace {

namespace fs = std::filesystem;

/// Everything in a bag.
struct BagContent {
  std::vector<ros::Time> times;  // of all messages as they stand in the file
  std::map<std::string, std::vector<sensor_msgs::CameraInfo>> infos;
  std::map<std::string, std::vector<sensor_msgs::Image>> images;
  std::map<std::string, std::vector<stereo_msgs::DisparityImage>> disparities;
};

/// rosbag::View sorts by time, so the order in the file is read from its bytes: the header of a message has
/// the field "time", after its length.
std::vector<ros::Time> timesInFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const std::string field("\x0d\0\0\0time=", 9);
  std::vector<ros::Time> times;
  for (auto at = bytes.find(field); at != std::string::npos; at = bytes.find(field, at + 1)) {
    std::uint32_t time[2];
    std::memcpy(time, &bytes[at + field.size()], sizeof(time));
    times.emplace_back(time[0], time[1]);
  }
  return times;
}

BagContent readBag(const std::string& path) {
  BagContent content;
  content.times = timesInFile(path);
  rosbag::Bag bag(path);
  rosbag::View view(bag);
  for (const rosbag::MessageInstance& message : view) {
    if (const auto info = message.instantiate<sensor_msgs::CameraInfo>()) {
      content.infos[message.getTopic()].push_back(*info);
      EXPECT_EQ(info->header.stamp, message.getTime());
    } else if (const auto image = message.instantiate<sensor_msgs::Image>()) {
      content.images[message.getTopic()].push_back(*image);
      EXPECT_EQ(image->header.stamp, message.getTime());
    } else if (const auto disparity = message.instantiate<stereo_msgs::DisparityImage>()) {
      content.disparities[message.getTopic()].push_back(*disparity);
      EXPECT_EQ(disparity->header.stamp, message.getTime());
    }
  }
  return content;
}

class KittiToBag : public testing::Test {
 protected:
  /// Options for the folder `name` of the test.
  KittiToBagOptions options(const std::string& name) const {
    KittiToBagOptions result;
    result.input = (folder_ / name).string();
    result.output = (folder_ / "out.bag").string();
    return result;
  }

  BagContent converted(const KittiToBagOptions& options) const {
    convertKitti(options);
    return readBag(options.output);
  }

  /// The message of the error, which must leave neither the bag nor a part of it.
  std::string errorOf(const KittiToBagOptions& options) const {
    std::string message = "no error";
    try {
      convertKitti(options);
    } catch (const std::exception& error) {
      message = error.what();
    }
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_.string())) {
      EXPECT_EQ(entry.path().filename().string().find("out.bag"), std::string::npos) << entry.path();
    }
    return message;
  }

  TemporaryFolder folder_;
};

void expectContains(const std::string& text, const std::string& part) {
  EXPECT_NE(text.find(part), std::string::npos) << text;
}

TEST_F(KittiToBag, writesTheTopicsOfARectifiedStereoCamera) {
  writeOdometry(folder_ / "00");
  const BagContent bag = converted(options("00"));
  EXPECT_EQ(bag.times.size(), 12U);
  for (const std::string side : {"left", "right"}) {
    const auto& images = bag.images.at("/stereo/" + side + "/image_rect");
    ASSERT_EQ(images.size(), 3U);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(images[i].encoding, "mono8");
      EXPECT_EQ(images[i].width, 64U);
      EXPECT_EQ(images[i].height, 48U);
      EXPECT_EQ(images[i].step, 64U);
      EXPECT_EQ(images[i].header.seq, i);
      ASSERT_EQ(images[i].data.size(), 64U * 48U);
      EXPECT_EQ(images[i].data[100], 10 * i + (side == "left" ? 0 : 1));
    }
    EXPECT_EQ(bag.infos.at("/stereo/" + side + "/camera_info").size(), 3U);
  }
}

TEST_F(KittiToBag, cameraInfosAreComplete) {
  writeOdometry(folder_ / "00");
  const BagContent bag = converted(options("00"));
  for (const auto& [topic, infos] : bag.infos) {
    for (const sensor_msgs::CameraInfo& info : infos) {
      EXPECT_EQ(info.width, 64U);
      EXPECT_EQ(info.height, 48U);
      EXPECT_EQ(info.distortion_model, "plumb_bob");
      EXPECT_EQ(info.D, std::vector<double>(5, 0.0));
      const boost::array<double, 9> k{{100, 0, 31.5, 0, 100, 23.5, 0, 0, 1}},
          identity{{1, 0, 0, 0, 1, 0, 0, 0, 1}};
      EXPECT_EQ(info.K, k) << topic;
      EXPECT_EQ(info.R, identity) << topic;
      const double minus_f_times_baseline = topic == "/stereo/right/camera_info" ? -50.0 : 0.0;
      const boost::array<double, 12> p{{100, 0, 31.5, minus_f_times_baseline, 0, 100, 23.5, 0, 0, 0, 1, 0}};
      EXPECT_EQ(info.P, p) << topic;
    }
  }
}

TEST_F(KittiToBag, everythingIsInTheFrameOfTheLeftCamera) {
  writeBenchmark(folder_ / "training");
  const BagContent bag = converted(options("training"));
  std::vector<std::string> frame_ids;
  for (const auto& [topic, infos] : bag.infos) {
    for (const auto& info : infos) frame_ids.push_back(info.header.frame_id);
  }
  for (const auto& [topic, images] : bag.images) {
    for (const auto& image : images) frame_ids.push_back(image.header.frame_id);
  }
  for (const auto& [topic, disparities] : bag.disparities) {
    for (const auto& disparity : disparities) {
      frame_ids.push_back(disparity.header.frame_id);
      frame_ids.push_back(disparity.image.header.frame_id);
    }
  }
  ASSERT_EQ(frame_ids.size(), 12U);
  EXPECT_NE(frame_ids.front(), "");
  EXPECT_EQ(std::count(frame_ids.begin(), frame_ids.end(), frame_ids.front()), 12);
}

TEST_F(KittiToBag, colorKeepsTheProjectionOfTheLeftCamera) {
  writeOdometry(folder_ / "00");
  KittiToBagOptions color = options("00");
  color.cameras = KittiCameras::COLOR;
  color.name_space = "/kitti_stereo/";
  const BagContent bag = converted(color);
  const sensor_msgs::Image& image = bag.images.at("/kitti_stereo/left/image_rect_color").at(1);
  EXPECT_EQ(image.encoding, "bgr8");
  EXPECT_EQ(image.step, 3U * 64U);
  EXPECT_EQ(image.data.at(0), 12);
  EXPECT_EQ(bag.images.at("/kitti_stereo/right/image_rect_color").at(1).data.at(0), 13);
  EXPECT_EQ(bag.infos.at("/kitti_stereo/left/camera_info").at(0).P[3], 6.0);
  EXPECT_EQ(bag.infos.at("/kitti_stereo/right/camera_info").at(0).P[3], -44.0);
}

TEST_F(KittiToBag, messagesAreInTheOrderOfTheirTimes) {
  writeOdometry(folder_ / "00");
  const BagContent bag = converted(options("00"));
  ASSERT_EQ(bag.times.size(), 12U);
  EXPECT_TRUE(std::is_sorted(bag.times.begin(), bag.times.end()));
  EXPECT_GT(bag.times.front(), ros::Time(0));
  EXPECT_EQ(bag.times.back() - bag.times.front(), ros::Duration(0, 207472000));
}

TEST_F(KittiToBag, theRightImageOfARawDriveTakesTheLeftTimeUnlessAskedOtherwise) {
  writeRaw(folder_ / "day/drive");
  KittiToBagOptions raw = options("day/drive");
  BagContent bag = converted(raw);
  EXPECT_EQ(bag.images.at("/stereo/left/image_rect").at(0).header.stamp, ros::Time(1317042145, 964389445));
  EXPECT_EQ(bag.images.at("/stereo/right/image_rect").at(0).header.stamp, ros::Time(1317042145, 964389445));

  raw.original_stamps = true;
  raw.overwrite = true;
  bag = converted(raw);
  EXPECT_EQ(bag.images.at("/stereo/left/image_rect").at(0).header.stamp, ros::Time(1317042145, 964389445));
  EXPECT_EQ(bag.images.at("/stereo/right/image_rect").at(0).header.stamp, ros::Time(1317042145, 964889445));
  EXPECT_EQ(bag.infos.at("/stereo/right/camera_info").at(0).header.stamp, ros::Time(1317042145, 964889445));
}

TEST_F(KittiToBag, anEarlierRightImageIsWrittenFirst) {
  writeRaw(folder_ / "day/drive");
  for (const char* camera : {"image_00", "image_01"}) {
    fs::rename(folder_ / "day/drive" / camera / "timestamps.txt", folder_ / camera);
  }
  fs::rename(folder_ / "image_00", folder_ / "day/drive/image_01/timestamps.txt");
  fs::rename(folder_ / "image_01", folder_ / "day/drive/image_00/timestamps.txt");
  KittiToBagOptions raw = options("day/drive");
  raw.original_stamps = true;
  const BagContent bag = converted(raw);
  EXPECT_TRUE(std::is_sorted(bag.times.begin(), bag.times.end()));
  EXPECT_EQ(bag.images.at("/stereo/right/image_rect").at(0).header.stamp, ros::Time(1317042145, 964389445));
  EXPECT_EQ(bag.images.at("/stereo/left/image_rect").at(0).header.stamp, ros::Time(1317042145, 964889445));
}

TEST_F(KittiToBag, framesOfABenchmarkMayDifferInSize) {
  writeBenchmark(folder_ / "training");
  KittiToBagOptions benchmark = options("training");
  benchmark.rate = 4.0;
  const BagContent bag = converted(benchmark);
  const auto& images = bag.images.at("/stereo/left/image_rect");
  const auto& infos = bag.infos.at("/stereo/left/camera_info");
  ASSERT_EQ(images.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(images[i].width, 64U + 4U * i);
    EXPECT_EQ(infos[i].width, images[i].width);
  }
  EXPECT_EQ(images[1].header.stamp - images[0].header.stamp, ros::Duration(0.25));
}

TEST_F(KittiToBag, groundTruthIsADisparityImage) {
  writeBenchmark(folder_ / "training");
  const BagContent bag = converted(options("training"));
  const auto& disparities = bag.disparities.at("/stereo/ground_truth/disparity");
  ASSERT_EQ(disparities.size(), 2U);
  const stereo_msgs::DisparityImage& disparity = disparities[1];
  EXPECT_EQ(disparity.header.stamp, bag.images.at("/stereo/left/image_rect")[1].header.stamp);
  EXPECT_EQ(disparity.image.encoding, "32FC1");
  EXPECT_EQ(disparity.image.width, 68U);
  EXPECT_EQ(disparity.f, 100.0F);
  EXPECT_EQ(disparity.T, 0.5F);
  EXPECT_EQ(disparity.min_disparity, 0.0F);
  EXPECT_GT(disparity.max_disparity, 2.5F);
  EXPECT_GT(disparity.delta_d, 0.0F);
  const auto value = [&](int x, int y) {
    float d = 0.0F;
    std::memcpy(&d, &disparity.image.data[y * disparity.image.step + sizeof(float) * x], sizeof(float));
    return d;
  };
  EXPECT_EQ(value(7, 5), 2.5F);  // disp_noc comes first
  EXPECT_EQ(value(8, 5), -1.0F);
  EXPECT_EQ(value(67, 47), -1.0F);
}

TEST_F(KittiToBag, groundTruthMayBeOfTheOtherFolderOrAbsent) {
  writeBenchmark(folder_ / "training");
  fs::remove_all(folder_ / "training/disp_noc");
  BagContent bag = converted(options("training"));
  ASSERT_EQ(bag.disparities.size(), 1U);
  EXPECT_GT(bag.disparities.at("/stereo/ground_truth/disparity").at(0).max_disparity, 5.0F);

  // It was made for the gray camera.
  KittiToBagOptions color = options("training");
  color.cameras = KittiCameras::COLOR;
  color.overwrite = true;
  EXPECT_TRUE(converted(color).disparities.empty());

  fs::remove_all(folder_ / "training/disp_occ");
  KittiToBagOptions none = options("training");
  none.overwrite = true;
  bag = converted(none);
  EXPECT_TRUE(bag.disparities.empty());
  EXPECT_EQ(bag.images.at("/stereo/left/image_rect").size(), 2U);
}

TEST_F(KittiToBag, takesAPart) {
  writeOdometry(folder_ / "00");
  KittiToBagOptions part = options("00");
  part.start = 1;
  part.frames = 1;
  std::vector<std::pair<int, int>> progress;
  EXPECT_EQ(convertKitti(part, [&](int done, int total) { progress.emplace_back(done, total); }), 1);
  const std::vector<std::pair<int, int>> expected{{1, 1}};
  EXPECT_EQ(progress, expected);
  EXPECT_EQ(readBag(part.output).images.at("/stereo/left/image_rect").at(0).data[0], 10);

  part.frames = 100;
  part.overwrite = true;
  EXPECT_EQ(convertKitti(part), 2);
}

TEST_F(KittiToBag, badOptionsAreRefused) {
  writeOdometry(folder_ / "00");
  KittiToBagOptions bad = options("00");
  bad.start = 3;
  EXPECT_EQ(errorOf(bad), "start is 3, expected 0 ... 2");
  bad = options("00");
  bad.start = -1;
  EXPECT_EQ(errorOf(bad), "start is -1, expected 0 ... 2");
  bad = options("00");
  bad.frames = -1;
  EXPECT_EQ(errorOf(bad), "frames is -1, expected at least 0");
  for (const char* name_space : {"", "/", "my camera"}) {
    bad = options("00");
    bad.name_space = name_space;
    expectContains(errorOf(bad), std::string("namespace is \"") + name_space + "\"");
  }
}

TEST_F(KittiToBag, missingFilesLeaveNoBag) {
  writeOdometry(folder_ / "00");
  fs::remove(folder_ / "00/image_1/000002.png");
  expectContains(errorOf(options("00")), (folder_ / "00/image_1/000002.png").string() + ": no such file");
  writeOdometry(folder_ / "01");
  fs::remove(folder_ / "01/calib.txt");
  expectContains(errorOf(options("01")), (folder_ / "01/calib.txt").string() + ": no such file");
  expectContains(errorOf(options("02")), (folder_ / "02").string() + ": no such folder");
}

TEST_F(KittiToBag, aCalibrationWithoutTheCameraLeavesNoBag) {
  writeOdometry(folder_ / "00");
  writeText(folder_ / "00/calib.txt", projectionLine("P0", 0.0));
  const std::string error = errorOf(options("00"));
  expectContains(error, (folder_ / "00/calib.txt").string());
  expectContains(error, "P1");
}

TEST_F(KittiToBag, anUnreadableImageLeavesNoBag) {
  writeOdometry(folder_ / "00");
  // The last image, when the rest is written already.
  cv::Mat texture(200, 200, CV_8UC3);
  cv::randu(texture, 0, 256);
  for (const KittiCameras cameras : {KittiCameras::GRAY, KittiCameras::COLOR}) {
    KittiToBagOptions unreadable = options("00");
    unreadable.cameras = cameras;
    const fs::path file =
        folder_ / (cameras == KittiCameras::GRAY ? "00/image_1/000002.png" : "00/image_3/000002.png");
    cv::imwrite(file.string(), texture);
    fs::resize_file(file, fs::file_size(file) / 2);
    expectContains(errorOf(unreadable), file.string());
    writeText(file, "no image");
    expectContains(errorOf(unreadable), file.string());
  }
}

TEST_F(KittiToBag, imagesOfDifferentSizeLeaveNoBag) {
  writeOdometry(folder_ / "00");
  writeGray(folder_ / "00/image_1/000001.png", 0, {64, 50});
  EXPECT_EQ(errorOf(options("00")), (folder_ / "00/image_1/000001.png").string() +
                                        ": 64x50 pixels, expected 64x48 as the left image");
  writeBenchmark(folder_ / "training");
  cv::imwrite((folder_ / "training/disp_noc/000004_10.png").string(),
              cv::Mat(48, 64, CV_16UC1, cv::Scalar(1)));
  EXPECT_EQ(errorOf(options("training")), (folder_ / "training/disp_noc/000004_10.png").string() +
                                              ": 64x48 pixels, expected 68x48 as the left image");
}

TEST_F(KittiToBag, aSwappedPairWithGroundTruthIsRefused) {
  writeBenchmark(folder_ / "training");
  writeText(folder_ / "training/calib/000004.txt", projectionLine("P0", 0.0) + projectionLine("P1", 50.0));
  expectContains(errorOf(options("training")), "baseline");
}

TEST_F(KittiToBag, anExistingBagIsKeptUnlessForced) {
  writeOdometry(folder_ / "00");
  const KittiToBagOptions first = options("00");
  writeText(first.output, "precious");
  EXPECT_THROW(convertKitti(first), std::runtime_error);
  EXPECT_EQ(fs::file_size(first.output), 8U);
  KittiToBagOptions forced = first;
  forced.overwrite = true;
  EXPECT_EQ(convertKitti(forced), 3);
  EXPECT_EQ(readBag(first.output).times.size(), 12U);

  // An error while overwriting keeps the former bag.
  const auto size = fs::file_size(first.output);
  writeText(folder_ / "00/image_1/000002.png", "no image");
  EXPECT_THROW(convertKitti(forced), std::runtime_error);
  EXPECT_EQ(fs::file_size(first.output), size);
  EXPECT_FALSE(fs::exists(first.output + ".active"));
}

TEST_F(KittiToBag, aBagThatCannotBeCreatedIsNamed) {
  writeOdometry(folder_ / "00");
  KittiToBagOptions unreachable = options("00");
  unreachable.output = (folder_ / "no/such/folder.bag").string();
  expectContains(errorOf(unreachable), unreachable.output);
  unreachable.output = folder_.string();
  unreachable.overwrite = true;
  expectContains(errorOf(unreachable), unreachable.output + ": is no file");
}

TEST_F(KittiToBag, anInterruptLeavesNoBag) {
  writeOdometry(folder_ / "00");
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    EXPECT_THROW(convertKitti(options("00"), [signal](int, int) { std::raise(signal); }), std::runtime_error);
    EXPECT_EQ(errorOf(options("03")), (folder_ / "03").string() + ": no such folder");
  }
  // The last frame was written: the bag is not completed either.
  EXPECT_THROW(convertKitti(options("00"),
                            [](int done, int total) {
                              if (done == total) std::raise(SIGINT);
                            }),
               std::runtime_error);
  EXPECT_FALSE(fs::exists(options("00").output));
  EXPECT_EQ(convertKitti(options("00")), 3);
}

TEST_F(KittiToBag, aFullDiskLeavesNoBag) {
  // A limit of the size of files stands for the disk.
  for (int i = 0; i < 3; ++i) {
    for (const char* camera : {"image_0", "image_1"}) {
      writeGray(folder_ / "00" / camera / numbered(i, 6, ".png"), 0, {1000, 1000});
    }
  }
  writeText(folder_ / "00/calib.txt", calibration("P"));
  writeText(folder_ / "00/times.txt", "0.0\n0.1\n0.2\n");
  rlimit former{};
  getrlimit(RLIMIT_FSIZE, &former);
  const auto former_handler = std::signal(SIGXFSZ, SIG_IGN);
  for (const rlim_t limit : {2500000, 5999000}) {
    rlimit limited = former;
    limited.rlim_cur = limit;
    setrlimit(RLIMIT_FSIZE, &limited);
    const std::string error = errorOf(options("00"));
    setrlimit(RLIMIT_FSIZE, &former);
    expectContains(error, options("00").output + ": cannot be written");
  }
  std::signal(SIGXFSZ, former_handler);
}

}  // namespace
}  // namespace disparity_refinement
