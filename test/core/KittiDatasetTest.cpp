#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "KittiFixture.hpp"
#include "disparity_refinement/evaluation/KittiDataset.hpp"

namespace disparity_refinement {
namespace {

namespace fs = std::filesystem;

constexpr std::int64_t START_OF_2011_09_26 = 1316995200000000000;  // date -u -d 2011-09-26 +%s%N

std::string errorOf(const fs::path& folder, KittiCameras cameras = KittiCameras::GRAY) {
  try {
    openKittiDataset(folder.string(), cameras);
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "no error";
}

void expectError(const std::string& error, const fs::path& file, const std::string& part) {
  EXPECT_EQ(error.find(file.string()), 0U) << error;
  EXPECT_NE(error.find(part), std::string::npos) << error;
}

TEST(KittiDataset, readsAnOdometrySequence) {
  const TemporaryFolder folder;
  writeOdometry(folder / "00");
  const KittiDataset dataset = openKittiDataset((folder / "00").string());
  EXPECT_EQ(dataset.layout, KittiLayout::ODOMETRY);
  ASSERT_EQ(dataset.frames.size(), 3U);
  const KittiFrame& frame = dataset.frames[1];
  EXPECT_EQ(frame.name, "000001");
  EXPECT_EQ(frame.left, folder / "00/image_0/000001.png");
  EXPECT_EQ(frame.right, folder / "00/image_1/000001.png");
  EXPECT_EQ(dataset.frames[0].left_stamp, START_OF_2011_09_26);
  EXPECT_EQ(frame.left_stamp, START_OF_2011_09_26 + 103736000);
  EXPECT_EQ(frame.right_stamp, frame.left_stamp);
  EXPECT_EQ(frame.left_projection, (ProjectionMatrix{100, 0, 31.5, 0, 0, 100, 23.5, 0, 0, 0, 1, 0}));
  EXPECT_EQ(frame.right_projection, (ProjectionMatrix{100, 0, 31.5, -50, 0, 100, 23.5, 0, 0, 0, 1, 0}));
  EXPECT_EQ(frame.disp_noc, "");
  EXPECT_EQ(frame.disp_occ, "");
}

TEST(KittiDataset, readsTheColorCameras) {
  const TemporaryFolder folder;
  writeOdometry(folder / "00");
  const KittiFrame frame = openKittiDataset((folder / "00").string(), KittiCameras::COLOR).frames.at(2);
  EXPECT_EQ(frame.left, folder / "00/image_2/000002.png");
  EXPECT_EQ(frame.right, folder / "00/image_3/000002.png");
  EXPECT_EQ(frame.left_projection[3], 6.0);
  EXPECT_EQ(frame.right_projection[3], -44.0);
}

TEST(KittiDataset, readsARawDriveWithTheCalibrationOfItsDay) {
  const TemporaryFolder folder;
  writeRaw(folder / "2011_09_26/drive");
  for (const std::string path : {"2011_09_26/drive", "2011_09_26/drive/"}) {
    const KittiDataset dataset = openKittiDataset((folder / path).string());
    EXPECT_EQ(dataset.layout, KittiLayout::RAW);
    ASSERT_EQ(dataset.frames.size(), 2U);
    const KittiFrame& frame = dataset.frames[0];
    EXPECT_EQ(frame.name, "0000000000");
    EXPECT_TRUE(fs::equivalent(frame.left, folder / "2011_09_26/drive/image_00/data/0000000000.png"));
    EXPECT_TRUE(fs::equivalent(frame.right, folder / "2011_09_26/drive/image_01/data/0000000000.png"));
    // date -u -d '2011-09-26 13:02:25.964389445' +%s%N
    EXPECT_EQ(frame.left_stamp, 1317042145964389445);
    EXPECT_EQ(frame.right_stamp, 1317042145964889445);
    EXPECT_EQ(frame.left_projection[3], 0.0);
    EXPECT_EQ(frame.right_projection[3], -50.0);
  }
}

TEST(KittiDataset, aCalibrationInsideTheDriveComesFirst) {
  const TemporaryFolder folder;
  writeRaw(folder / "day/drive");
  writeText(folder / "day/drive/calib_cam_to_cam.txt",
            projectionLine("P_rect_02", 7.0) + projectionLine("P_rect_03", -30.0));
  const KittiFrame frame =
      openKittiDataset((folder / "day/drive").string(), KittiCameras::COLOR).frames.at(0);
  EXPECT_EQ(frame.left_projection[3], 7.0);
  EXPECT_EQ(frame.right_projection[3], -30.0);
}

TEST(KittiDataset, readsABenchmarkFolder) {
  const TemporaryFolder folder;
  writeBenchmark(folder / "training");
  const KittiDataset dataset = openKittiDataset((folder / "training").string(), KittiCameras::GRAY, 4.0);
  EXPECT_EQ(dataset.layout, KittiLayout::STEREO_BENCHMARK);
  ASSERT_EQ(dataset.frames.size(), 2U);
  const KittiFrame& frame = dataset.frames[1];
  EXPECT_EQ(frame.name, "000004_10");
  EXPECT_EQ(frame.left, folder / "training/image_0/000004_10.png");
  EXPECT_EQ(frame.right, folder / "training/image_1/000004_10.png");
  EXPECT_EQ(frame.disp_noc, folder / "training/disp_noc/000004_10.png");
  EXPECT_EQ(frame.disp_occ, folder / "training/disp_occ/000004_10.png");
  EXPECT_EQ(frame.left_stamp, START_OF_2011_09_26 + 250000000);
  EXPECT_EQ(frame.right_stamp, frame.left_stamp);
  EXPECT_EQ(frame.right_projection[3], -50.0);
}

TEST(KittiDataset, groundTruthFoldersMayBeAbsent) {
  const TemporaryFolder folder;
  writeBenchmark(folder / "training");
  fs::remove_all(folder / "training/disp_occ");
  KittiFrame frame = openKittiDataset((folder / "training").string()).frames.at(0);
  EXPECT_NE(frame.disp_noc, "");
  EXPECT_EQ(frame.disp_occ, "");
  fs::remove_all(folder / "training/disp_noc");
  frame = openKittiDataset((folder / "training").string()).frames.at(0);
  EXPECT_EQ(frame.disp_noc, "");
}

TEST(KittiDataset, anUnknownLayoutIsRefused) {
  const TemporaryFolder folder;
  expectError(errorOf(folder / "none"), folder / "none", "no such folder");
  expectError(errorOf(folder.string()), folder.string(), "expected an odometry sequence");
}

TEST(KittiDataset, missingFilesAreNamed) {
  const TemporaryFolder folder;
  const fs::path odometry = folder / "odometry", raw = folder / "day/raw", benchmark = folder / "training";
  writeOdometry(odometry);
  writeRaw(raw);
  writeBenchmark(benchmark);
  const auto error_without = [&](const fs::path& dataset, const fs::path& file) {
    fs::rename(file, folder / "hidden");
    const std::string error = errorOf(dataset);
    fs::rename(folder / "hidden", file);
    return error;
  };
  for (const char* name : {"calib.txt", "times.txt", "image_1", "image_1/000001.png", "image_0/000001.png"}) {
    expectError(error_without(odometry, odometry / name), odometry / name, "no such f");
  }
  for (const char* name : {"image_01/data", "image_01/data/0000000001.png", "image_00/timestamps.txt",
                           "image_01/timestamps.txt", "../calib_cam_to_cam.txt"}) {
    expectError(error_without(raw, raw / name), raw / name, "no such f");
  }
  for (const char* name : {"image_1/000004_10.png", "image_0/000004_10.png", "calib/000004.txt",
                           "disp_noc/000004_10.png", "disp_occ/000004_10.png"}) {
    expectError(error_without(benchmark, benchmark / name), benchmark / name, "no such file");
  }
}

TEST(KittiDataset, incompleteFramesOfTheBenchmarkAreLeftOutWhenAsked) {
  for (const char* name : {"image_1/000004_10.png", "image_0/000004_10.png", "calib/000004.txt",
                           "disp_noc/000004_10.png", "disp_occ/000004_10.png"}) {
    const TemporaryFolder folder;
    const fs::path training = folder / "training";
    writeBenchmark(training);
    fs::remove(training / name);
    std::vector<IncompleteKittiFrame> incomplete;
    const KittiDataset dataset = openKittiDataset(training.string(), KittiCameras::GRAY, 10.0, &incomplete);
    ASSERT_EQ(dataset.frames.size(), 1U) << name;
    EXPECT_EQ(dataset.frames[0].name, "000000_10") << name;
    ASSERT_EQ(incomplete.size(), 1U) << name;
    EXPECT_EQ(incomplete[0].name, "000004_10");
    EXPECT_EQ(incomplete[0].problem.find((training / name).string()), 0U) << incomplete[0].problem;
  }
}

TEST(KittiDataset, groundTruthIsListedWithoutImages) {
  const TemporaryFolder folder;
  const fs::path training = folder / "training";
  writeBenchmark(training);
  for (const char* name : {"image_0", "image_1", "calib"}) fs::remove_all(training / name);
  EXPECT_EQ(listGroundTruth(training.string()).size(), 2U);
  fs::remove(training / "disp_noc/000004_10.png");
  EXPECT_THROW(listGroundTruth(training.string()), std::runtime_error);
  std::vector<IncompleteKittiFrame> incomplete;
  EXPECT_EQ(listGroundTruth(training.string(), &incomplete).size(), 1U);
  EXPECT_EQ(incomplete.size(), 1U);
  for (const char* name : {"disp_noc", "disp_occ"}) fs::remove_all(training / name);
  EXPECT_THROW(listGroundTruth(training.string()), std::runtime_error);
}

TEST(KittiDataset, aBenchmarkWithoutACompleteFrameIsRefused) {
  const TemporaryFolder folder;
  const fs::path training = folder / "training";
  writeBenchmark(training);
  fs::remove_all(training / "calib");
  std::vector<IncompleteKittiFrame> incomplete;
  try {
    openKittiDataset(training.string(), KittiCameras::GRAY, 10.0, &incomplete);
    ADD_FAILURE() << "nothing was thrown";
  } catch (const std::runtime_error& error) {
    EXPECT_EQ(std::string(error.what()).find(training.string() + ": no frame is complete: "), 0U)
        << error.what();
  }
}

TEST(KittiDataset, aFolderWithoutImagesIsRefused) {
  const TemporaryFolder folder;
  writeOdometry(folder / "00");
  fs::remove_all(folder / "00/image_0");
  fs::create_directory(folder / "00/image_0");
  expectError(errorOf(folder / "00"), folder / "00/image_0", "no image");
}

TEST(KittiDataset, aMissingCameraIsNamed) {
  const TemporaryFolder folder;
  writeOdometry(folder / "00");
  writeText(folder / "00/calib.txt", projectionLine("P0", 0.0));
  expectError(errorOf(folder / "00"), folder / "00/calib.txt", "P1");
  expectError(errorOf(folder / "00", KittiCameras::COLOR), folder / "00/calib.txt", "P2");
}

TEST(KittiDataset, everyImageNeedsATime) {
  const TemporaryFolder folder;
  writeOdometry(folder / "00");
  writeText(folder / "00/times.txt", "0.0\n0.1\n");
  expectError(errorOf(folder / "00"), folder / "00/times.txt", "2 times, expected at least 3");
}

TEST(KittiDataset, theNumberOfAnImageSaysItsLine) {
  const TemporaryFolder folder;
  writeOdometry(folder / "00");
  for (const char* name : {"image_0/000000.png", "image_1/000000.png"}) fs::remove(folder / "00" / name);
  const KittiDataset dataset = openKittiDataset((folder / "00").string());
  ASSERT_EQ(dataset.frames.size(), 2U);
  EXPECT_EQ(dataset.frames[0].left_stamp, START_OF_2011_09_26 + 103736000);
}

TEST(KittiDataset, timesMustBeNumbersThatRise) {
  const TemporaryFolder folder;
  writeOdometry(folder / "00");
  const fs::path times = folder / "00/times.txt";
  for (const char* bad :
       {"0.0\nten\n0.2\n", "0.0\n0.1 0.2\n0.3\n", "0.0\nnan\n0.2\n", "0.0\n1e300\n2e300\n"}) {
    writeText(times, bad);
    expectError(errorOf(folder / "00"), times, "line 2 is");
  }
  for (const char* bad : {"0.0\n0.0\n0.1\n", "0.1\n0.0\n0.2\n"}) {
    writeText(times, bad);
    expectError(errorOf(folder / "00"), times, "line 2 is not later");
  }
}

TEST(KittiDataset, datesAreReadStrictly) {
  const TemporaryFolder folder;
  const fs::path drive = folder / "day/drive", times = drive / "image_00/timestamps.txt";
  writeRaw(drive);
  const std::string second = "\n2011-09-26 13:02:26.068000000\n";
  for (const std::string bad :
       {"13:02:25.9", "2011-13-26 13:02:25.9", "2011-02-30 13:02:25.9", "2011-09-26 25:02:25.9",
        "2011-09-26 13:02:25,9", "1969-09-26 13:02:25.9", "2262-09-26 13:02:25.9", "9027-09-26 13:02:25.9",
        "2011-09-26 13:02:25.9x", "2011-09-26 13:02:25.1234567890"}) {
    writeText(times, bad + second);
    expectError(errorOf(drive), times, "line 1 is \"" + bad + "\"");
  }
  // Fewer digits are tenths, hundredths, ...; a trailing carriage return does not matter.
  writeText(times, "2011-09-26 13:02:25.5\r" + second);
  EXPECT_EQ(openKittiDataset(drive.string()).frames.at(0).left_stamp, 1317042145500000000);
  writeText(times, "2011-09-26 13:02:25" + second);
  EXPECT_EQ(openKittiDataset(drive.string()).frames.at(0).left_stamp, 1317042145000000000);
}

TEST(KittiDataset, aRateMustBePositive) {
  const TemporaryFolder folder;
  writeBenchmark(folder / "training");
  // Neither the largest time nor the difference of two of them gets lost.
  for (const double rate : {0.0, -1.0, 1e-12, 1e300, std::nan("")}) {
    EXPECT_THROW(openKittiDataset((folder / "training").string(), KittiCameras::GRAY, rate),
                 std::invalid_argument)
        << rate;
  }
}

}  // namespace
}  // namespace disparity_refinement
