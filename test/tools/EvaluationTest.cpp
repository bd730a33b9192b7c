#include <gtest/gtest.h>

#include <cstdlib>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <sstream>
#include <stdexcept>

#include "BenchmarkWriter.hpp"
#include "Evaluation.hpp"
#include "EvaluationReport.hpp"
#include "KittiFixture.hpp"
#include "disparity_refinement/evaluation/SyntheticStreet.hpp"

namespace disparity_refinement {
namespace {

namespace fs = std::filesystem;

constexpr int FRAMES = 4;

/// Frames of the synthetic street as a benchmark folder; the same for all tests.
const fs::path& streetFolder() {
  static const TemporaryFolder folder;
  static const fs::path path = [] {
    const fs::path training = folder / "training";
    StreetParameters parameters;
    parameters.width = 320;
    parameters.height = 120;
    parameters.focal_length = 200;
    const SyntheticStreet street(parameters);
    const double f = parameters.focal_length;
    const cv::Point2d c = street.principalPoint();
    BenchmarkWriter writer(training.string());
    for (int i = 0; i < FRAMES; ++i) {
      const StreetFrame frame = street.render(10 * i);
      writer.write(frame.left, frame.right, frame.disparity, {f, 0, c.x, 0, 0, f, c.y, 0, 0, 0, 1, 0},
                   {f, 0, c.x, -f * parameters.baseline, 0, f, c.y, 0, 0, 0, 1, 0});
    }
    return training;
  }();
  return path;
}

/// A copy of the street that a test may damage.
fs::path copyStreet(const TemporaryFolder& folder) {
  const fs::path copy = folder / "training";
  fs::copy(streetFolder(), copy, fs::copy_options::recursive);
  return copy;
}

std::vector<EvaluatedMethod> matcherAndRefinement() {
  EvaluatedMethod matcher;
  matcher.name = "matcher";
  matcher.parameters.set("disparity_range", "64");
  matcher.is_refined = false;
  EvaluatedMethod refined = matcher;
  refined.name = "matcher + (30,5)";
  refined.is_refined = true;
  return {matcher, refined};
}

EvaluatedMethod finishedMaps(const fs::path& folder) {
  EvaluatedMethod method;
  method.name = "maps";
  method.maps = folder.string();
  return method;
}

Evaluation evaluateFolder(const fs::path& folder, const std::vector<EvaluatedMethod>& methods,
                          const EvaluationOptions& options = {}) {
  return evaluate(openKittiDataset(folder.string()).frames, methods, options);
}

void expectEqual(const DisparityErrors& a, const DisparityErrors& b) {
  EXPECT_EQ(a.outliers, b.outliers);
  EXPECT_EQ(a.end_point_error, b.end_point_error);
}

void expectEqual(const EvaluationFigures& a, const EvaluationFigures& b) {
  ASSERT_EQ(a.scores.size(), b.scores.size());
  for (const auto& [kind, score] : a.scores) {
    expectEqual(score.all, b.scores.at(kind).all);
    expectEqual(score.est, b.scores.at(kind).est);
    EXPECT_EQ(score.density, b.scores.at(kind).density);
  }
}

TEST(Evaluation, refinementFillsHoles) {
  const Evaluation evaluation = evaluateFolder(streetFolder(), matcherAndRefinement());
  ASSERT_EQ(evaluation.frames.size(), static_cast<std::size_t>(FRAMES));
  const EvaluationFigures matcher = evaluation.mean(0), refined = evaluation.mean(1);
  EXPECT_GT(refined.scores.at("noc").density, matcher.scores.at("noc").density);
  EXPECT_EQ(matcher.segments, 0.0);
  EXPECT_GT(refined.segments, 1.0);
  EXPECT_GT(matcher.ms.matching, 0.0);
  EXPECT_EQ(matcher.ms.segmentation, 0.0);
  EXPECT_EQ(refined.ms.matching, matcher.ms.matching) << "computed once";
  EXPECT_GT(refined.ms.total(), refined.ms.matching);
  EXPECT_EQ(refined.scores.count("occ"), 0U) << "there is no such folder";
}

TEST(Evaluation, isThatOfTheCore) {
  const KittiFrame files = openKittiDataset(streetFolder().string()).frames.front();
  const std::vector<EvaluatedMethod> methods = matcherAndRefinement();
  const Evaluation evaluation = evaluate({files}, methods, {});

  const cv::Mat left = readGrayImage(files.left);
  StereoMatcher matcher(methods[1].parameters.matching());
  cv::Mat disparity, labels, refined;
  matcher.compute(left, readGrayImage(files.right), disparity);
  Segmentation().compute(left, {}, labels);
  PlaneRefinement().refine(disparity, labels, matcher.range(), 100.0, {}, refined);
  const cv::Mat truth = readDisparityPng(files.disp_noc);
  const cv::Mat png = roundToKittiPng(refined, matcher.range());
  EvaluationFigures expected;
  expected.scores["noc"] = scoreDisparity(png, KITTI_PNG_RANGE, truth);
  expectEqual(evaluation.figures[1][0], expected);
}

TEST(Evaluation, doesNotDependOnTheNumberOfThreads) {
  EvaluationOptions options;
  const Evaluation one = evaluateFolder(streetFolder(), matcherAndRefinement(), options);
  options.threads = 3;
  const Evaluation three = evaluateFolder(streetFolder(), matcherAndRefinement(), options);
  ASSERT_EQ(one.frames, three.frames);
  for (std::size_t m = 0; m < one.methods.size(); ++m) {
    expectEqual(one.mean(m), three.mean(m));
    for (std::size_t i = 0; i < one.frames.size(); ++i) {
      expectEqual(one.figures[m][i], three.figures[m][i]);
      EXPECT_EQ(one.figures[m][i].segments, three.figures[m][i].segments);
    }
  }
}

TEST(Evaluation, doesNotDependOnTheMethodsBefore) {
  const EvaluatedMethod refined = matcherAndRefinement()[1];
  std::vector<EvaluatedMethod> methods{refined, refined, refined, refined};
  methods[1].parameters.set("lambda", "5");
  methods[2].parameters.set("correlation_window_size", "7");
  for (std::size_t m = 0; m < methods.size(); ++m) methods[m].name = std::to_string(m);
  const Evaluation evaluation = evaluateFolder(streetFolder(), methods);
  expectEqual(evaluation.mean(3), evaluation.mean(0));
  EXPECT_NE(evaluation.mean(1).segments, evaluation.mean(0).segments);
  EXPECT_NE(evaluation.mean(2).scores.at("noc").density, evaluation.mean(0).scores.at("noc").density);
  EXPECT_EQ(evaluation.mean(2).segments, evaluation.mean(0).segments);
}

TEST(Evaluation, writtenMapsReadBackToTheSameFigures) {
  const TemporaryFolder folder;
  EvaluationOptions options;
  options.write_maps = (folder / "maps").string();
  const std::vector<EvaluatedMethod> methods = matcherAndRefinement();
  const Evaluation computed = evaluateFolder(streetFolder(), methods, options);
  for (std::size_t m = 0; m < methods.size(); ++m) {
    const fs::path maps = folder / "maps" / folderName(methods[m].name);
    const Evaluation read = evaluateFolder(streetFolder(), {finishedMaps(maps)});
    for (int i = 0; i < FRAMES; ++i) expectEqual(computed.figures[m][i], read.figures[0][i]);
  }
}

TEST(Evaluation, scoresEachKindOfGroundTruth) {
  const TemporaryFolder folder;
  const fs::path training = copyStreet(folder);
  fs::copy(training / "disp_noc", training / "disp_occ");
  // One more pixel is known there, and no map is right about it.
  for (const fs::directory_entry& entry : fs::directory_iterator(training / "disp_occ")) {
    cv::Mat truth = cv::imread(entry.path().string(), cv::IMREAD_UNCHANGED);
    truth.setTo(60000, truth == 0);
    cv::imwrite(entry.path().string(), truth);
  }
  const EvaluationFigures mean = evaluateFolder(training, matcherAndRefinement()).mean(1);
  EXPECT_GT(mean.scores.at("occ").all.outliers[4], mean.scores.at("noc").all.outliers[4]);
}

TEST(Evaluation, takesTheMeanOfTheImagesAndNotOfThePixels) {
  const TemporaryFolder folder;
  writeBenchmark(folder / "training");
  // Frame 0: 1 pixel, wrong. Frame 4: 3 pixels, right.
  for (const int number : {0, 4}) {
    const cv::Size size(64 + number, 48);
    cv::Mat truth(size, CV_16UC1, cv::Scalar(0)), map(size, CV_16UC1, cv::Scalar(0));
    truth(cv::Rect(0, 0, number == 0 ? 1 : 3, 1)).setTo(10 * 256);
    map(cv::Rect(0, 0, number == 0 ? 1 : 3, 1)).setTo(number == 0 ? 20 * 256 : 10 * 256);
    const std::string name = numbered(number, 6, "_10.png");
    for (const char* kind : {"disp_noc", "disp_occ"}) {
      cv::imwrite((folder / "training" / kind / name).string(), truth);
    }
    fs::create_directories(folder / "maps");
    cv::imwrite((folder / "maps" / name).string(), map);
  }
  const EvaluationFigures mean = evaluateFolder(folder / "training", {finishedMaps(folder / "maps")}).mean(0);
  EXPECT_EQ(mean.scores.at("noc").all.outliers[2], 0.5) << "pooled it would be 0.25";
  EXPECT_EQ(mean.scores.at("noc").all.end_point_error, 5.0);
  EXPECT_EQ(mean.scores.at("occ").density, 1.0);
}

TEST(Evaluation, theValueOneOfAPngIsADisparity) {
  const TemporaryFolder folder;
  writeBenchmark(folder / "training");
  fs::create_directories(folder / "maps");
  for (const int number : {0, 4}) {
    const cv::Mat map(48, 64 + number, CV_16UC1, cv::Scalar(1));
    cv::imwrite((folder / "maps" / numbered(number, 6, "_10.png")).string(), map);
  }
  const EvaluationFigures mean = evaluateFolder(folder / "training", {finishedMaps(folder / "maps")}).mean(0);
  EXPECT_EQ(mean.scores.at("noc").density, 1.0);
  EXPECT_EQ(mean.scores.at("noc").est.end_point_error, 2.5 - 1.0 / 256.0);
}

/// What damages one frame of a folder, and what the error must name.
struct Damage {
  const char* description;
  const char* file;
  void (*apply)(const fs::path& file);
};

void removeFile(const fs::path& file) { fs::remove(file); }
void makeText(const fs::path& file) { writeText(file, "no image"); }
void makeEmptyTruth(const fs::path& file) {
  cv::imwrite(file.string(), cv::Mat(120, 320, CV_16UC1, cv::Scalar(0)));
}
void makeEightBit(const fs::path& file) {
  cv::imwrite(file.string(), cv::Mat(120, 320, CV_8UC1, cv::Scalar(9)));
}
void makeSmaller(const fs::path& file) {
  const cv::Mat image = cv::imread(file.string(), cv::IMREAD_UNCHANGED);
  cv::imwrite(file.string(), image(cv::Rect(0, 0, 300, 120)));
}

constexpr Damage DAMAGES[] = {
    {"no left image", "image_0/000001_10.png", removeFile},
    {"no right image", "image_1/000001_10.png", removeFile},
    {"no ground truth", "disp_noc/000001_10.png", removeFile},
    {"no calibration", "calib/000001.txt", removeFile},
    {"a calibration without matrices", "calib/000001.txt", makeText},
    {"an unreadable left image", "image_0/000001_10.png", makeText},
    {"an unreadable right image", "image_1/000001_10.png", makeText},
    {"an unreadable ground truth", "disp_noc/000001_10.png", makeText},
    {"a ground truth of 8 bits", "disp_noc/000001_10.png", makeEightBit},
    {"a ground truth without a pixel", "disp_noc/000001_10.png", makeEmptyTruth},
    {"a ground truth of another size", "disp_noc/000001_10.png", makeSmaller},
    {"a right image of another size", "image_1/000001_10.png", makeSmaller},
};

TEST(Evaluation, namesTheFileThatIsBad) {
  for (const Damage& damage : DAMAGES) {
    const TemporaryFolder folder;
    const fs::path training = copyStreet(folder);
    const fs::path file = training / damage.file;
    damage.apply(file);
    const std::string text = refusal([&] { evaluateFolder(training, matcherAndRefinement()); });
    EXPECT_NE(text.find(file.string()), std::string::npos) << damage.description << ": " << text;
  }
}

TEST(Evaluation, scoresTheOtherFramesWhenItKeepsGoing) {
  for (const Damage& damage : DAMAGES) {
    const TemporaryFolder folder;
    const fs::path training = copyStreet(folder);
    const fs::path file = training / damage.file;
    damage.apply(file);
    EvaluationOptions options;
    options.keep_going = true;
    std::vector<IncompleteKittiFrame> incomplete;
    const KittiDataset dataset = openKittiDataset(training.string(), KittiCameras::GRAY, 10.0, &incomplete);
    const Evaluation evaluation = evaluate(dataset.frames, matcherAndRefinement(), options);
    std::vector<std::string> left_out = evaluation.left_out;
    for (const IncompleteKittiFrame& frame : incomplete) left_out.push_back(frame.problem);
    EXPECT_EQ(evaluation.frames, (std::vector<std::string>{"000000_10", "000002_10", "000003_10"}))
        << damage.description;
    ASSERT_EQ(left_out.size(), 1U) << damage.description;
    EXPECT_NE(left_out[0].find(file.string()), std::string::npos)
        << damage.description << ": " << left_out[0];
    for (const auto& figures : evaluation.figures) EXPECT_EQ(figures.size(), evaluation.frames.size());
  }
}

TEST(Evaluation, refusesWhatCannotBeScored) {
  const TemporaryFolder folder;
  const auto refusalOf = [&](const std::vector<EvaluatedMethod>& methods,
                             const EvaluationOptions& options = {}) {
    return refusal([&] { evaluateFolder(streetFolder(), methods, options); });
  };
  fs::create_directories(folder / "maps");
  EXPECT_NE(refusalOf({finishedMaps(folder / "nowhere")}).find("nowhere: no such folder"), std::string::npos);
  EXPECT_NE(refusalOf({finishedMaps(folder / "maps")}).find("maps/000000_10.png"), std::string::npos);
  EvaluationOptions keep_going;
  keep_going.keep_going = true;
  EXPECT_EQ(refusalOf({finishedMaps(folder / "maps")}, keep_going).find("no frame could be scored"), 0U);

  std::vector<EvaluatedMethod> methods = matcherAndRefinement();
  methods[1].name = methods[0].name;
  EXPECT_EQ(refusalOf(methods), "two methods are called matcher");
  methods = matcherAndRefinement();
  methods[1].parameters.set("correlation_window_size", "4");
  EXPECT_EQ(refusalOf(methods, keep_going).find("correlation_window_size is 4"), 0U) << "before any frame";
  EvaluationOptions no_threads;
  no_threads.threads = 0;
  EXPECT_EQ(refusalOf(matcherAndRefinement(), no_threads), "threads is 0, expected at least 1");
  writeText(folder / "file", "");
  EvaluationOptions no_folder;
  no_folder.write_maps = (folder / "file" / "maps").string();
  EXPECT_NE(refusalOf(matcherAndRefinement(), no_folder).find(no_folder.write_maps), std::string::npos);
}

TEST(Evaluation, drawsAPictureOfEveryRefinedFrame) {
  const TemporaryFolder folder;
  EvaluationOptions options;
  options.pictures = (folder / "pictures").string();
  evaluateFolder(streetFolder(), matcherAndRefinement(), options);
  int pictures = 0;
  for (const auto& entry : fs::recursive_directory_iterator(options.pictures)) {
    if (!entry.is_regular_file()) continue;
    ++pictures;
    const cv::Mat picture = cv::imread(entry.path().string());
    EXPECT_GT(picture.cols, 2 * 320) << "two columns";
    EXPECT_GT(picture.rows, 3 * 120) << "image and segments, two maps, two errors";
  }
  EXPECT_EQ(pictures, FRAMES);
}

TEST(EvaluationReport, jsonHasTheDocumentedSchema) {
  const TemporaryFolder folder;
  EvaluationOptions options;
  options.write_maps = (folder / "maps").string();
  std::vector<EvaluatedMethod> methods = matcherAndRefinement();
  evaluateFolder(streetFolder(), methods, options);
  methods.push_back(finishedMaps(folder / "maps" / folderName(methods[1].name)));
  const Evaluation evaluation = evaluateFolder(streetFolder(), methods);
  const std::string file = (folder / "figures.json").string();
  writeJson(evaluation, file);

  nlohmann::json json;
  std::ifstream(file) >> json;
  ASSERT_EQ(json.size(), 3U);
  for (std::size_t m = 0; m < 3; ++m) {
    const nlohmann::json& method = json[m];
    const KittiScore score = evaluation.mean(m).scores.at("noc");
    EXPECT_EQ(method.at("name"), methods[m].name);
    EXPECT_EQ(method.at("frames"), FRAMES);
    EXPECT_DOUBLE_EQ(method.at("noc").at("density"), 100.0 * score.density);
    for (int tau = 1; tau <= 5; ++tau) {
      EXPECT_DOUBLE_EQ(method.at("noc").at("all").at(std::to_string(tau)),
                       100.0 * score.all.outliers[tau - 1]);
      EXPECT_DOUBLE_EQ(method.at("noc").at("est").at(std::to_string(tau)),
                       100.0 * score.est.outliers[tau - 1]);
    }
    EXPECT_DOUBLE_EQ(method.at("noc").at("all").at("epe"), score.all.end_point_error);
    EXPECT_DOUBLE_EQ(method.at("noc").at("est").at("epe"), score.est.end_point_error);
    EXPECT_FALSE(method.contains("occ"));
    for (const char* stage : {"matching", "segmentation", "refinement", "total"}) {
      EXPECT_EQ(method.at("ms").at(stage).is_null(), m == 2) << stage;
    }
  }
  EXPECT_EQ(json[0].at("parameters").at("disparity_range"), 64);
  EXPECT_FALSE(json[0].at("parameters").contains("lambda")) << "the matcher has none";
  EXPECT_EQ(json[1].at("parameters").at("lambda"), 30);
  EXPECT_TRUE(json[0].at("segments").is_null());
  EXPECT_DOUBLE_EQ(json[1].at("segments"), evaluation.mean(1).segments);
  EXPECT_TRUE(json[2].at("parameters").empty());
}

TEST(EvaluationReport, csvHasALineForEveryFrameAndTheMean) {
  const TemporaryFolder folder;
  const Evaluation evaluation = evaluateFolder(streetFolder(), matcherAndRefinement());
  const std::string file = (folder / "figures.csv").string();
  writeCsv(evaluation, file);
  std::ifstream stream(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  ASSERT_EQ(lines.size(), 1U + 2 * (FRAMES + 1));
  EXPECT_EQ(lines[0].find("method,frame,ground_truth,density,all_1"), 0U);
  EXPECT_EQ(lines[1].find("\"matcher\",000000_10,noc,"), 0U);
  EXPECT_EQ(lines.back().find("\"matcher + (30,5)\",mean,noc,"), 0U);
  // The name of a method holds a comma.
  const auto columns = [](const std::string& line) { return std::count(line.begin(), line.end(), ','); };
  EXPECT_EQ(columns(lines[1]), columns(lines[0]));
  EXPECT_EQ(columns(lines.back()), columns(lines[0]) + 1);
}

TEST(EvaluationReport, namesTheFileThatItCannotWrite) {
  const TemporaryFolder folder;
  const Evaluation evaluation = evaluateFolder(streetFolder(), matcherAndRefinement());
  const std::string file = (folder / "no" / "figures").string();
  EXPECT_EQ(refusal([&] { writeJson(evaluation, file); }), "cannot write " + file);
  EXPECT_EQ(refusal([&] { writeCsv(evaluation, file); }), "cannot write " + file);
}

TEST(EvaluationReport, tellsWhatWasLeftOut) {
  Evaluation evaluation = evaluateFolder(streetFolder(), matcherAndRefinement());
  evaluation.left_out = {"frame 7: gone"};
  std::ostringstream text;
  printTables(evaluation, text);
  EXPECT_NE(text.str().find("frame 7: gone"), std::string::npos);
  EXPECT_NE(text.str().find("matcher + (30,5)"), std::string::npos);
  EXPECT_NE(text.str().find("disp_noc, 4 frames"), std::string::npos);
}

TEST(FolderName, keepsWhatMakesNamesDiffer) {
  EXPECT_EQ(folderName("SGBM 3WAY + (30,5)"), "SGBM_3WAY_+_30,5");
  EXPECT_EQ(folderName("a/../b"), "a_.._b");
}

/// What holds on real frames, wherever they come from: the refinement of KITTI's own SGBM settings gives
/// denser and more accurate maps.
TEST(Kitti, refinementImprovesTheBaselineOfThePaper) {
  const char* folder = std::getenv("DISPARITY_REFINEMENT_KITTI");
  if (folder == nullptr) {
    std::cout << "DISPARITY_REFINEMENT_KITTI is not set: no KITTI frame looked at\n";
    return;
  }
  std::vector<KittiFrame> frames = openKittiDataset(folder).frames;
  if (frames.size() > 10) frames.resize(10);
  const TemporaryFolder maps;
  EvaluationOptions options;
  options.threads = 2;
  options.write_maps = maps.string();
  EvaluatedMethod matcher;
  matcher.name = "SGBM";
  matcher.is_refined = false;
  matcher.parameters.load(PARAMS_FOLDER "/kitti_sgbm.yaml");
  std::vector<EvaluatedMethod> methods{matcher, matcher, matcher};
  for (const std::size_t m : {1, 2}) {
    methods[m].is_refined = true;
    methods[m].name = m == 1 ? "(5,2)" : "(30,5)";
    methods[m].parameters.set("lambda", m == 1 ? "5" : "30");
    methods[m].parameters.set("h", m == 1 ? "2" : "5");
  }
  const Evaluation evaluation = evaluate(frames, methods, options);
  const KittiScore raw = evaluation.mean(0).scores.at("noc");
  // Of the order of the published figures of OCV-SGBM.
  EXPECT_GT(raw.density, 0.75);
  EXPECT_LT(raw.density, 0.95);
  EXPECT_LT(raw.all.outliers[2], 0.25);
  for (const std::size_t m : {1, 2}) {
    const KittiScore refined = evaluation.mean(m).scores.at("noc");
    EXPECT_GT(refined.density, raw.density);
    for (const std::size_t tau : {2, 3, 4}) {
      EXPECT_LT(refined.all.outliers[tau - 1], raw.all.outliers[tau - 1]) << methods[m].name << ", > " << tau;
    }
    EXPECT_LT(refined.all.end_point_error, raw.all.end_point_error) << methods[m].name;
    const Evaluation read = evaluate(frames, {finishedMaps(maps / folderName(methods[m].name))}, {});
    for (std::size_t i = 0; i < frames.size(); ++i) expectEqual(evaluation.figures[m][i], read.figures[0][i]);
  }
}

}  // namespace
}  // namespace disparity_refinement
