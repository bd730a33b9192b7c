#include <gtest/gtest.h>

#include <stdexcept>
#include <string>
#include <utility>

#include "KittiFixture.hpp"
#include "StageParameters.hpp"

namespace disparity_refinement {
namespace {

TEST(StageParameters, startsWithTheDefaultsOfTheCore) {
  const StageParameters parameters;
  EXPECT_EQ(parameters.matching().correlation_window_size, MatchingParameters().correlation_window_size);
  EXPECT_EQ(parameters.segmentation().lambda, SegmentationParameters().lambda);
  EXPECT_EQ(parameters.refinement().planes.max_divergence, PlaneRefinementParameters().max_divergence);
}

TEST(StageParameters, setsEachTypeByItsName) {
  StageParameters parameters;
  parameters.set("full_width", "true");
  parameters.set("min_disparity", "-16");
  parameters.set("h", "7");
  parameters.set("inlier_threshold", "2");
  parameters.set("shadow_gamma", "0.5");
  EXPECT_TRUE(parameters.matching().full_width);
  EXPECT_EQ(parameters.matching().min_disparity, -16);
  EXPECT_EQ(parameters.segmentation().h, 7);
  EXPECT_EQ(parameters.refinement().planes.inlier_threshold, 2.0);
  EXPECT_EQ(parameters.segmentation().gradient.shadow_gamma, 0.5);
  EXPECT_EQ(std::get<int>(parameters.values().at("h")), 7);
  EXPECT_EQ(parameters.values().size(),
            parameters.matchingValues().size() + 7 /* segmentation */ + 14 /* refinement */);
}

TEST(StageParameters, haveTheModesOfTheLaunchFiles) {
  StageParameters parameters;
  EXPECT_FALSE(parameters.matching().full_width);
  EXPECT_EQ(parameters.refinement().mode, RefinementMode::PAPER);
  parameters.setMode("quality");
  EXPECT_TRUE(parameters.matching().full_width);
  EXPECT_TRUE(parameters.matching().aggregate_rows);
  EXPECT_EQ(parameters.matching().stereo_algorithm, StereoAlgorithm::SGBM);
  EXPECT_EQ(parameters.refinement().mode, RefinementMode::QUALITY);
  parameters = {};
  parameters.setMode("fast");
  EXPECT_TRUE(parameters.matching().full_width);
  EXPECT_FALSE(parameters.matching().aggregate_rows);
  EXPECT_EQ(parameters.matching().stereo_algorithm, StereoAlgorithm::CENSUS_SGM);
  EXPECT_EQ(parameters.refinement().mode, RefinementMode::PAPER);
  parameters = {};
  parameters.setMode("paper");
  EXPECT_EQ(parameters.values(), StageParameters().values());
  EXPECT_THROW(parameters.setMode("best"), std::invalid_argument);
}

TEST(StageParameters, refusesWhatANodeletWouldReplace) {
  StageParameters parameters;
  EXPECT_EQ(refusal([&] { parameters.set("lambda", "-1"); }),
            "lambda is -1, expected an integer in 0 ... 1000000");
  EXPECT_EQ(refusal([&] { parameters.set("h", "2.5"); }), "h is 2.5, expected an integer in 0 ... 255");
  EXPECT_EQ(refusal([&] { parameters.set("confidence", "nan"); }),
            "confidence is nan, expected a number in 0.5 ... 0.9999");
  EXPECT_EQ(refusal([&] { parameters.set("confidence", ".nan"); }),
            "confidence is .nan, expected a number in 0.5 ... 0.9999");
  EXPECT_EQ(refusal([&] { parameters.set("lambda", "010"); }),
            "lambda is 010, expected an integer in 0 ... 1000000")
      << "8 or 10?";
  EXPECT_EQ(refusal([&] { parameters.set("full_width", "2"); }), "full_width is 2, expected true or false");
  EXPECT_NE(refusal([&] { parameters.set("h", "["); }).find("h is "), std::string::npos);
  EXPECT_NE(refusal([&] { parameters.set("h", ""); }).find("h is "), std::string::npos);
  EXPECT_EQ(refusal([&] { parameters.set("lamda", "5"); }),
            "lamda is no parameter of disparity, segmentation or plane_refinement");
  EXPECT_EQ(parameters.segmentation().lambda, SegmentationParameters().lambda) << "nothing was changed";

  parameters.set("correlation_window_size", "4");
  EXPECT_EQ(refusal([&] { parameters.matching(); }),
            "correlation_window_size is 4, the nearest allowed value is 5");
}

TEST(StageParameters, theWindowMayBeSetBeforeTheAlgorithm) {
  StageParameters parameters;
  parameters.set("correlation_window_size", "21");
  EXPECT_NE(refusal([&] { parameters.matching(); }), "") << "too large for SGBM";
  parameters.set("stereo_algorithm", "0");
  EXPECT_EQ(parameters.matching().correlation_window_size, 21);
}

TEST(StageParameters, thePenaltiesMustFitTheAlgorithm) {
  StageParameters parameters;
  parameters.set("P2", "800");
  EXPECT_EQ(parameters.matching().P2, 800);
  parameters.set("stereo_algorithm", "2");
  EXPECT_EQ(refusal([&] { parameters.matching(); }), "P2 is 800, the nearest allowed value is 224");
  parameters.set("P2", "224");
  EXPECT_EQ(parameters.matching().stereo_algorithm, StereoAlgorithm::CENSUS_SGM);
  EXPECT_EQ(refusal([&] { parameters.set("stereo_algorithm", "3"); }),
            "stereo_algorithm is 3, expected an integer in 0 ... 2");
}

TEST(StageParameters, readsTheFilesOfParams) {
  for (const auto& [file, matcher] :
       {std::pair{"/kitti_bm.yaml", "BM"}, std::pair{"/kitti_sgbm.yaml", "SGBM HH"},
        std::pair{"/kitti_census_sgm.yaml", "census SGM"}}) {
    StageParameters parameters;
    EXPECT_TRUE(parameters.load(std::string(PARAMS_FOLDER) + file).empty()) << file;
    EXPECT_EQ(matcherName(parameters.matching()), matcher) << file;
  }
}

TEST(StageParameters, matchersHaveNames) {
  MatchingParameters parameters;
  EXPECT_EQ(matcherName(parameters), "SGBM 3WAY");
  parameters.sgbm_mode = SgbmMode::HH4;
  EXPECT_EQ(matcherName(parameters), "SGBM HH4");
  parameters.stereo_algorithm = StereoAlgorithm::BM;
  EXPECT_EQ(matcherName(parameters), "BM");
  parameters.stereo_algorithm = StereoAlgorithm::CENSUS_SGM;
  EXPECT_EQ(matcherName(parameters), "census SGM");
}

TEST(StageParameters, readsTheFileOfTheLaunchFiles) {
  const TemporaryFolder folder;
  const std::string file = (folder / "parameters.yaml").string();
  writeText(
      file,
      "disparity: {sgbm_mode: 1, queue_size: 3}\nsegmentation:\n  lambda: 80\n  shadow_enhancement: off\n"
      "plane_refinement: {max_divergence: 5}\nvisualization: {color_max_disparity: 32.0}\n");
  StageParameters parameters;
  EXPECT_EQ(parameters.load(file), (std::vector<std::string>{"disparity/queue_size", "visualization"}));
  EXPECT_EQ(parameters.matching().sgbm_mode, SgbmMode::HH);
  EXPECT_EQ(parameters.segmentation().lambda, 80);
  EXPECT_FALSE(parameters.segmentation().gradient.shadow_enhancement);
  EXPECT_EQ(parameters.refinement().planes.max_divergence, 5.0);
}

TEST(StageParameters, namesTheFileThatItCannotRead) {
  const TemporaryFolder folder;
  const std::string file = (folder / "parameters.yaml").string();
  StageParameters parameters;
  const auto load = [&](const std::string& text) {
    writeText(file, text);
    return refusal([&] { parameters.load(file); });
  };
  EXPECT_NE(refusal([&] { parameters.load(file); }).find(file), std::string::npos) << "no such file";
  for (const std::string text : {"segmentation: {lambda: -1}", "segmentation: 5", "- 1\n- 2", "a: [", "text",
                                 "segmentation: {lambda: [1, 2]}", "segmentation: {? [1]: 2}"}) {
    EXPECT_EQ(load(text).find(file), 0U) << text;
  }
  EXPECT_EQ(load(""), "") << "an empty file sets nothing";
  EXPECT_EQ(load("segmentation:"), "");
}

TEST(StageParameters, optionsWinOverTheFile) {
  const TemporaryFolder folder;
  const std::string file = (folder / "parameters.yaml").string();
  writeText(file, "segmentation: {lambda: 80, h: 15}\n");
  namespace po = boost::program_options;
  po::options_description description;
  StageParameters::addOptions(description);
  const char* arguments[] = {"tool", "--params",      file.c_str(), "--h", "3", "--min_disparity",
                             "-16",  "--max_slope_x", "0.5"};
  po::variables_map values;
  po::store(po::parse_command_line(9, arguments, description), values);
  StageParameters parameters;
  parameters.readOptions(values);
  EXPECT_EQ(parameters.segmentation().lambda, 80);
  EXPECT_EQ(parameters.segmentation().h, 3);
  EXPECT_EQ(parameters.matching().min_disparity, -16);
  EXPECT_EQ(parameters.refinement().planes.max_slope_x, 0.5);
}

TEST(StageParameters, tellsWhichStageDiffers) {
  StageParameters a, b;
  EXPECT_TRUE(a.hasSameMatching(b));
  b.set("lambda", "5");
  b.set("max_divergence", "1");
  EXPECT_TRUE(a.hasSameMatching(b));
  EXPECT_FALSE(a.hasSameSegmentation(b));
  a.set("lambda", "5");
  EXPECT_TRUE(a.hasSameSegmentation(b));
  a.set("P1", "10");
  EXPECT_FALSE(a.hasSameMatching(b));
}

}  // namespace
}  // namespace disparity_refinement
