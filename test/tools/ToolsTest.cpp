// The programs as a user starts them: arguments, files that they write, errors and exit codes.

#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "KittiFixture.hpp"
#include "RunTool.hpp"
#include "disparity_refinement/evaluation/KittiFiles.hpp"
#include "disparity_refinement/segmentation/Segmentation.hpp"

namespace disparity_refinement {
namespace {

namespace fs = std::filesystem;

std::string readText(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/// A benchmark folder of the street, made by render_street.
class Tools : public testing::Test {
 protected:
  Tools() : training((folder / "training").string()) {
    expectGood("render_street " + training + " --frames 3 --width 320 --height 120");
  }

  std::string image(const std::string& camera) const { return training + "/" + camera + "/000000_10.png"; }
  std::string pair() const { return image("image_0") + " " + image("image_1") + " --disparity_range 64"; }
  std::string out(const std::string& name) const { return (folder / name).string(); }

  const TemporaryFolder folder;
  const std::string training;
};

TEST_F(Tools, streetFolderIsNeverOverwritten) {
  for (const char* force : {"", " --force"}) {
    expectError("render_street " + training + force,
                training + " exists already, expected a new or an empty folder");
  }
  EXPECT_TRUE(fs::exists(training + "/image_0/000002_10.png"));
  expectError("render_street " + out("bad") + " --width 9", "width is 9");
  EXPECT_FALSE(fs::exists(out("bad")));
}

TEST_F(Tools, evaluatePrintsAndWritesItsFigures) {
  const Outcome outcome =
      run("evaluate " + training + " --disparity_range 64 --variant lambda=5,h=2 --variant h=9" +
          " --frames 0,2 --json " + out("a.json") + " --csv " + out("a.csv") + " --write-maps " +
          out("maps") + " --pictures " + out("pictures"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("disp_noc, 2 frames"), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("SGBM 3WAY + lambda=5,h=2"), std::string::npos) << outcome.text;
  EXPECT_EQ(outcome.text.find('#'), std::string::npos) << "no progress bar without a terminal";
  EXPECT_TRUE(fs::exists(out("a.json")));
  EXPECT_TRUE(fs::exists(out("a.csv")));
  EXPECT_TRUE(fs::exists(out("pictures/SGBM_3WAY_+_h=9/000002_10.png")));

  const std::string maps = out("maps/SGBM_3WAY_+_h=9");
  const Outcome scored = run("evaluate " + training + " --frames 0,2 --maps " + maps + " --name others");
  EXPECT_EQ(scored.exit_code, 0) << scored.text;
  // The same figures behind another name.
  const auto figures = [](const std::string& text, const std::string& name) {
    const auto start = text.find("\n" + name) + 1 + name.size();
    return text.substr(text.find_first_not_of(' ', start),
                       text.find('\n', start) - text.find_first_not_of(' ', start));
  };
  EXPECT_EQ(figures(outcome.text, "SGBM 3WAY + h=9"), figures(scored.text, "others"));
}

TEST_F(Tools, evaluateRunsEveryMatcherOnceInAnyOrderOfTheVariants) {
  const Outcome outcome = run("evaluate " + training + " --disparity_range 64 --variant h=1 " +
                              "--variant full_width=true,h=2 --variant h=3 --variant h=4,full_width=true "
                              "--variant stereo_algorithm=2 " +
                              "--json " + out("a.json"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  const std::string json = readText(out("a.json"));
  for (const std::string name :
       {"SGBM 3WAY", "SGBM 3WAY + h=1", "SGBM 3WAY, full_width=true", "SGBM 3WAY + full_width=true,h=2",
        "SGBM 3WAY + h=3", "SGBM 3WAY + h=4,full_width=true", "census SGM, stereo_algorithm=2",
        "census SGM + stereo_algorithm=2"}) {
    const std::string text = "\"name\": \"" + name + "\"";
    const auto at = json.find(text);
    EXPECT_NE(at, std::string::npos) << name;
    EXPECT_EQ(json.find(text, at + 1), std::string::npos) << name;
  }
}

TEST_F(Tools, evaluateRefinesBeyondThePaper) {
  const std::string settings = training + " --disparity_range 64 --full_width true --frames 0 --mode quality";
  const Outcome outcome = run("evaluate " + settings + " --ablation --json " + out("a.json"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  // The matcher, the planes, six more steps, and six times all steps but one.
  const std::string json = readText(out("a.json"));
  int methods = 0;
  for (auto at = json.find("\"name\""); at != std::string::npos; at = json.find("\"name\"", at + 1))
    ++methods;
  EXPECT_EQ(methods, 14);
  for (const std::string name :
       {"SGBM 3WAY + (30,5) quality: planes", "+ plane selection", "+ plane smoothing", "+ pixel labeling",
        "+ less weight behind edges", "+ soft output", "+ medians", "all without medians"}) {
    EXPECT_NE(json.find("\"name\": \"" + name + "\""), std::string::npos) << name;
  }

  // One more step, with it and without.
  const Outcome further = run("evaluate " + settings + " --ablation --further_segmentations 1");
  EXPECT_EQ(further.exit_code, 0) << further.text;
  EXPECT_NE(further.text.find("\n+ further segmentations "), std::string::npos) << further.text;
  EXPECT_NE(further.text.find("\nall without further segmentations "), std::string::npos) << further.text;

  // There are no holes.
  expectGood("evaluate " + settings + " --variant h=5 --write-maps " + out("maps"));
  const cv::Mat map = cv::imread(out("maps/SGBM_3WAY_+_h=5_quality/000000_10.png"), cv::IMREAD_UNCHANGED);
  ASSERT_FALSE(map.empty());
  EXPECT_LE(static_cast<int>(map.total()) - cv::countNonZero(map), 1);
}

TEST_F(Tools, evaluateScoresMapsWithoutImages) {
  expectGood("evaluate " + training + " --disparity_range 64 --write-maps " + out("maps"));
  for (const char* name : {"image_0", "image_1", "calib"}) fs::remove_all(training + "/" + name);
  expectGood("evaluate " + training + " --maps " + out("maps/SGBM_3WAY"));
}

TEST_F(Tools, evaluateLooksAtTheSelectedFramesOnly) {
  fs::remove(training + "/image_1/000001_10.png");
  expectGood("evaluate " + training + " --disparity_range 64 --frames 0,2");
  expectError("evaluate " + training + " --frames 1-2", training + "/image_1/000001_10.png");
  const Outcome outcome = run("evaluate " + training + " --disparity_range 64 --frames 0 --keep-going");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_EQ(outcome.text.find("Left out"), std::string::npos) << outcome.text;
  expectError("evaluate " + training + " --frames 1 --keep-going", "no frame could be scored");
}

TEST_F(Tools, evaluateKeepsGoingWhenAsked) {
  writeText(training + "/image_1/000001_10.png", "no image");
  fs::remove(training + "/disp_noc/000002_10.png");
  expectError("evaluate " + training, training + "/disp_noc/000002_10.png");
  const Outcome outcome = run("evaluate " + training + " --disparity_range 64 --keep-going");
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  EXPECT_NE(outcome.text.find("disp_noc, 1 frames"), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find("Left out, 2 frames"), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find(training + "/disp_noc/000002_10.png"), std::string::npos) << outcome.text;
  EXPECT_NE(outcome.text.find(training + "/image_1/000001_10.png"), std::string::npos) << outcome.text;
}

TEST_F(Tools, evaluateExplainsWhatItCannotDo) {
  expectError("evaluate", "expected TRAINING_DIR");
  expectError("evaluate " + out("nowhere"), "nowhere: no such folder");
  expectError("evaluate " + training + " --frames 7",
              "frames is 7, expected numbers of frames, which are 0 ... 2");
  expectError("evaluate " + training + " --frames a", "frames is a, expected numbers and ranges");
  expectError("evaluate " + training + " --lambda -1", "lambda is -1, expected an integer in 0 ... 1000000");
  expectError("evaluate " + training + " --lambda many", "lambda is many");
  expectError("evaluate " + training + " --variant lambda", "variant is lambda, expected NAME=VALUE");
  expectError("evaluate " + training + " --variant =1", "variant is =1, expected NAME=VALUE");
  expectError("evaluate " + training + " --variant h=1 --maps x", "--variant and --maps exclude each other");
  expectError("evaluate " + training + " --lambda 1 --maps x", "--lambda and --maps exclude each other");
  expectError("evaluate " + training + " --name x", "--name is for --maps");
  expectError("evaluate " + training + " --mode best", "mode is best, expected paper, fast or quality");
  expectError("evaluate " + training + " --ablation", "--ablation is for --mode quality");
  expectError("evaluate " + training + " --mode quality --ablation --variant h=1 --variant h=2",
              "--ablation is for one variant");
  expectError("evaluate " + training + " --mode quality --maps x", "--mode and --maps exclude each other");
  expectError("evaluate " + training + " --json " + out("no/a.json"), "cannot write " + out("no/a.json"));
  expectError("evaluate " + training + " --params " + out("none.yaml"), "none.yaml");
  expectGood("evaluate " + training + " --disparity_range 64 --threads 100000");
  expectError("evaluate " + training + " --threads 0", "threads is 0, expected at least 1");
  fs::rename(training + "/disp_noc", out("hidden"));
  expectError("evaluate " + training, training + ": no ground truth");
  const Outcome help = run("evaluate --help");
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_NE(help.text.find("--min_valid_fraction"), std::string::npos);
}

TEST_F(Tools, refineWritesEveryFormat) {
  const std::string calibration = " --calibration " + training + "/calib/000000.txt";
  expectGood("refine " + pair() + calibration + " -o " + out("map.png") + " --color " + out("color.png") +
             " --pfm " + out("map.pfm") + " --ply " + out("cloud.ply") + " --picture " + out("picture.png"));
  const cv::Mat png = readDisparityPng(out("map.png"));
  const cv::Mat pfm = cv::imread(out("map.pfm"), cv::IMREAD_UNCHANGED);
  ASSERT_EQ(pfm.type(), CV_32FC1);
  ASSERT_EQ(pfm.size(), png.size());
  int valid = 0, positive = 0;
  for (int y = 0; y < png.rows; ++y) {
    for (int x = 0; x < png.cols; ++x) {
      const float d = png.at<float>(y, x), f = pfm.at<float>(y, x);
      EXPECT_EQ(std::isinf(f), d == 0.0F) << x << ", " << y;
      if (d == 0.0F) continue;
      EXPECT_NEAR(f, d, 1.0 / 256.0) << x << ", " << y;
      ++valid;
      positive += f > 0.0F ? 1 : 0;
    }
  }
  EXPECT_GT(valid, 320 * 120 / 2);
  EXPECT_EQ(cv::imread(out("color.png")).size(), png.size());
  EXPECT_GT(cv::imread(out("picture.png")).cols, 2 * png.cols);

  const std::string ply = readText(out("cloud.ply"));
  EXPECT_EQ(ply.find("ply\nformat binary_"), 0U);
  EXPECT_NE(ply.find("element vertex " + std::to_string(positive) + "\n"), std::string::npos);
  const auto data = ply.find("end_header\n") + 11;
  EXPECT_EQ(ply.size() - data, static_cast<std::size_t>(positive) * 15);
}

TEST_F(Tools, refineGivesTheMapOfEvaluate) {
  expectGood("evaluate " + training + " --disparity_range 64 --lambda 10 --h 3 --write-maps " + out("maps"));
  expectGood("refine " + pair() + " --lambda 10 --h 3 --calibration " + training + "/calib/000000.txt -o " +
             out("map.png"));
  const cv::Mat a = readDisparityPng(out("maps/SGBM_3WAY_+_10,3/000000_10.png")),
                b = readDisparityPng(out("map.png"));
  EXPECT_EQ(cv::norm(a, b, cv::NORM_INF), 0.0);
}

TEST_F(Tools, refineWritesMapAndColoursByDefault) {
  expectGood("refine --help");
  const fs::path before = fs::current_path();
  fs::current_path(out(""));
  expectGood("refine " + pair());
  expectGood("refine " + pair() + " --mode quality -o " + out("quality.png"));
  expectError("refine " + pair() + " --mode best", "mode is best, expected paper, fast or quality");
  fs::current_path(before);
  EXPECT_TRUE(fs::exists(out("disparity_refined.png")));
  EXPECT_TRUE(fs::exists(out("disparity_refined_color.png")));
}

TEST_F(Tools, refineWritesSourceAndConfidence) {
  for (const std::string mode : {"paper", "quality"}) {
    expectGood("refine " + pair() + " --mode " + mode + " -o " + out("map.png") + " --source-map " +
               out("source.png") + " --confidence-map " + out("confidence.png"));
    const cv::Mat map = readDisparityPng(out("map.png"));
    const cv::Mat source = cv::imread(out("source.png"), cv::IMREAD_UNCHANGED);
    const cv::Mat confidence = cv::imread(out("confidence.png"), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(source.type(), CV_8UC1) << mode;
    ASSERT_EQ(confidence.type(), CV_8UC1) << mode;
    // In the PNG a disparity of 0 is 1/256 px, so that 0 is unknown there too.
    EXPECT_EQ(cv::countNonZero((map > 0.0F) != (source > 0)), 0) << mode;
    EXPECT_EQ(cv::countNonZero(confidence & (source == 0)), 0) << mode;
    double low = 0.0, high = 0.0;
    cv::minMaxLoc(source, &low, &high);
    EXPECT_EQ(high, mode == "paper" ? 2.0 : 3.0) << mode;
    EXPECT_GT(cv::countNonZero(source == 1), static_cast<int>(source.total()) / 2) << mode;
  }
  expectError("refine " + pair() + " --source-map " + out("source.jpg"), "a file name that ends with .png");
}

TEST_F(Tools, evaluateCountsErrorsByConfidence) {
  const Outcome outcome =
      run("evaluate " + training + " --disparity_range 64 --mode quality --by-confidence" + " --json " +
          out("a.json"));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.text;
  const std::string json = readText(out("a.json"));
  for (const std::string name :
       {"measured", "own plane", "neighbour's plane", "filled", "confidence 0-31", "confidence 224-255"}) {
    EXPECT_NE(outcome.text.find("\n  " + name + " "), std::string::npos) << name << "\n" << outcome.text;
    EXPECT_NE(json.find("\"" + name + "\""), std::string::npos) << name;
  }
  // What was measured is a smaller risk than what was filled.
  const auto wrong = [&json](const std::string& name) {
    const auto at = json.find("\"wrong\": ", json.find("\"" + name + "\""));
    return std::stod(json.substr(at + 9));
  };
  EXPECT_LT(wrong("measured"), wrong("own plane"));
  EXPECT_LT(wrong("confidence 224-255"), wrong("confidence 96-127"));
}

TEST_F(Tools, refineExplainsWhatItCannotDo) {
  writeGray(folder / "small.png", 9);
  writeText(folder / "text.png", "no image");
  expectError("refine " + image("image_0"), "expected RIGHT");
  expectError("refine " + image("image_0") + " " + out("none.png"), "cannot open " + out("none.png"));
  expectError("refine " + image("image_0") + " " + out("text.png"),
              out("text.png") + " is not a readable image");
  expectError("refine " + image("image_0") + " " + out("small.png"),
              out("small.png") + ": 64x48 pixels, expected 320x120 as the left image");
  expectError("refine " + pair() + " --ply " + out("cloud.ply"), "--ply needs --calibration");
  expectError("refine " + pair() + " --focal-length 200", "--focal-length and --baseline need each other");
  expectError("refine " + pair() + " --focal-length 0 --baseline 1", "focal length");
  expectError("refine " + pair() + " --focal-length 200 --baseline 1 --calibration x",
              "--calibration excludes");
  expectError("refine " + pair() + " -o " + out("no/map.png"), "cannot write " + out("no/map.png"));
  expectError("refine " + pair() + " --color " + out("no/map.png"), "cannot write " + out("no/map.png"));
  expectError("refine " + pair() + " --color " + out("map.nothing"), "cannot write " + out("map.nothing"));
  expectError("refine " + pair() + " --color-max -1", "color-max is -1");
  EXPECT_EQ(run("refine " + pair() + " --min_disparity 64 --output " + out("far.png")).exit_code, 0);
  expectError("refine " + pair() + " --pfm " + out("a.png"), "expected a file name that ends with .pfm");
  expectError("refine " + pair() + " -o " + out("a.png") + " --color " + out("a.png"),
              "is the name of two outputs");
  expectError("refine " + pair() + " --disparity_error 0.5",
              "disparity_error is 0.5, expected --calibration");
  expectError("refine " + image("image_0") + " " + folder.string(),
              folder.string() + " is a folder, expected a file");
  expectError("refine " + pair() + " --calibration " + out("text.png"),
              out("text.png") + ": no line starts with");
  expectError("refine " + image("image_0") + " " + image("image_1") + " --disparity_range 512", "512");
}

TEST_F(Tools, influenceSurfaceCountsWhatTheWatershedCounts) {
  expectGood("influence_surface " + image("image_0") + " -o " + out("surface"));
  std::ifstream stream(out("surface/surface.csv"));
  std::string line;
  std::getline(stream, line);
  EXPECT_EQ(line, "lambda,h,segments");
  const cv::Mat gray = readGrayImage(image("image_0"));
  Segmentation segmentation;
  cv::Mat labels;
  int rows = 0;
  while (std::getline(stream, line)) {
    SegmentationParameters parameters;
    int segments = 0;
    ASSERT_EQ(std::sscanf(line.c_str(), "%d,%d,%d", &parameters.lambda, &parameters.h, &segments), 3);
    const bool is_sampled = rows++ % 97 == 0;
    if (is_sampled) {
      EXPECT_EQ(segments, segmentation.compute(gray, parameters, labels)) << line;
    }
  }
  EXPECT_EQ(rows, 161 * 61);
  EXPECT_EQ(cv::imread(out("surface/surface.png")).size(), cv::Size(1100, 800));
  EXPECT_GT(cv::imread(out("surface/segments.png")).cols, 2 * 320);

  // A flat image has one segment.
  writeGray(folder / "flat.png", 9);
  expectGood("influence_surface " + out("flat.png") + " -o " + out("flat"));
}

TEST_F(Tools, influenceSurfaceExplainsWhatItCannotDo) {
  expectError("influence_surface " + out("none.png"), "cannot open " + out("none.png"));
  expectError("influence_surface " + image("image_0") + " --max-lambda 20",
              "max-lambda is 20, expected 80 ...");
  expectError("influence_surface " + image("image_0") + " --max-lambda 1001", "max-lambda is 1001");
  expectError("influence_surface " + image("image_0") + " --max-h 256", "max-h is 256, expected 15 ... 255");
  writeText(folder / "file", "");
  expectError("influence_surface " + image("image_0") + " -o " + out("file"), out("file"));

  // The counts are there even if they cannot be drawn.
  const std::string arguments = "influence_surface " + image("image_0") + " -o " + out("surface");
  const Outcome outcome = run(arguments, "PATH=/nowhere");
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.text.find("gnuplot is not installed"), std::string::npos) << outcome.text;
  EXPECT_TRUE(fs::exists(out("surface/surface.csv")));
  EXPECT_TRUE(fs::exists(out("surface/segments.png")));
  EXPECT_FALSE(fs::exists(out("surface/surface.png")));
}

}  // namespace
}  // namespace disparity_refinement
