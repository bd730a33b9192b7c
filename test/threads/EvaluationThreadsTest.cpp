#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "BenchmarkWriter.hpp"
#include "Evaluation.hpp"
#include "KittiFixture.hpp"
#include "disparity_refinement/evaluation/SyntheticStreet.hpp"

namespace disparity_refinement {
namespace {

// Frames beside each other, one of them bad: for ThreadSanitizer.
TEST(EvaluationThreads, scoreFramesLikeOne) {
  const TemporaryFolder folder;
  const std::string training = (folder / "training").string();
  StreetParameters street_parameters;
  street_parameters.width = 128;
  street_parameters.height = 64;
  const SyntheticStreet street(street_parameters);
  BenchmarkWriter writer(training);
  for (int i = 0; i < 6; ++i) {
    const StreetFrame frame = street.render(i);
    writer.write(frame.left, frame.right, frame.disparity, {100, 0, 64, 0, 0, 100, 32, 0, 0, 0, 1, 0},
                 {100, 0, 64, -50, 0, 100, 32, 0, 0, 0, 1, 0});
  }
  writeText(folder / "training/image_1/000003_10.png", "no image");

  EvaluatedMethod matcher, quality;
  matcher.name = "matcher";
  matcher.is_refined = false;
  matcher.parameters.set("disparity_range", "32");
  quality.name = "quality";
  quality.parameters.setMode("quality");
  quality.parameters.set("stereo_algorithm", "2");
  EvaluationOptions options;
  options.keep_going = true;
  options.confidence = true;
  options.write_maps = (folder / "maps").string();
  const std::vector<KittiFrame> frames = openKittiDataset(training).frames;
  const Evaluation one = evaluate(frames, {matcher, quality}, options);
  options.threads = 3;
  int calls = 0;
  const Evaluation three = evaluate(frames, {matcher, quality}, options, [&calls](int, int) { ++calls; });
  EXPECT_EQ(calls, 6);
  ASSERT_EQ(three.frames.size(), 5U);
  EXPECT_EQ(three.frames, one.frames);
  EXPECT_EQ(three.left_out, one.left_out);
  for (std::size_t method = 0; method < 2; ++method) {
    for (std::size_t i = 0; i < 5; ++i) {
      EXPECT_EQ(three.figures[method][i].scores.at("noc").all.end_point_error,
                one.figures[method][i].scores.at("noc").all.end_point_error);
    }
  }
}

}  // namespace
}  // namespace disparity_refinement
