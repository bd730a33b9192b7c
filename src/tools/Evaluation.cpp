#include "Evaluation.hpp"

#include <algorithm>
#include <atomic>
#include <cctype>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <exception>
#include <filesystem>
#include <mutex>
#include <opencv2/core.hpp>
#include <set>
#include <stdexcept>
#include <thread>

#include "OutputFiles.hpp"
#include "disparity_refinement/StereoGeometry.hpp"
#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/evaluation/KittiFiles.hpp"
#include "disparity_refinement/visualization/RefinementPicture.hpp"

namespace disparity_refinement {
namespace {

namespace fs = std::filesystem;

/// Runs a step and returns its time [ms].
template <class Step>
double timed(const Step& step) {
  const auto start = std::chrono::steady_clock::now();
  step();
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
}

/// Images, geometry and ground truth of one frame.
struct LoadedFrame {
  std::string name;
  cv::Mat left, right;  ///< Empty if all methods have finished maps.
  cv::Size size;
  StereoGeometry geometry;
  std::map<std::string, cv::Mat> ground_truth;
};

LoadedFrame load(const KittiFrame& files, bool with_images) {
  LoadedFrame frame;
  frame.name = files.name;
  if (with_images) {
    frame.left = readGrayImage(files.left);
    frame.right = readGrayImage(files.right);
    frame.size = frame.left.size();
    requireSizeOfLeftImage(files.right, frame.right, frame.size);
    frame.geometry = stereoGeometry(files.left_projection, files.right_projection);
  }
  const auto load_truth = [&](const char* kind, const std::string& file) {
    if (file.empty()) return;
    cv::Mat truth = readDisparityPng(file);
    if (frame.size.empty()) frame.size = truth.size();
    requireSizeOfLeftImage(file, truth, frame.size);
    if (cv::countNonZero(truth) == 0) {
      throw std::runtime_error(file + " has no pixel above 0, expected a ground truth");
    }
    frame.ground_truth[kind] = truth;
  };
  load_truth("noc", files.disp_noc);
  load_truth("occ", files.disp_occ);
  return frame;
}

/// Computes and scores the maps of one frame after the other. One object serves one thread.
class FrameEvaluator {
 public:
  FrameEvaluator(const std::vector<EvaluatedMethod>& methods, const EvaluationOptions& options)
      : methods_(methods), options_(options) {
    with_images_ = std::any_of(methods.begin(), methods.end(),
                               [](const EvaluatedMethod& method) { return method.isComputed(); });
  }

  /// One entry a method.
  std::vector<EvaluationFigures> evaluate(const KittiFrame& files) {
    const LoadedFrame frame = load(files, with_images_);
    std::vector<EvaluationFigures> figures(methods_.size());
    matched_ = segmented_ = nullptr;
    for (std::size_t i = 0; i < methods_.size(); ++i) figures[i] = evaluate(frame, methods_[i]);
    return figures;
  }

 private:
  EvaluationFigures evaluate(const LoadedFrame& frame, const EvaluatedMethod& method) {
    EvaluationFigures figures;
    if (method.isComputed()) {
      match(frame, method.parameters);
      figures.ms.matching = matching_ms_;
      if (method.isRefined()) {
        refine(frame, method, figures);
      } else {
        map_ = roundToKittiPng(disparity_, matcher_.range(frame.geometry.principal_point_offset));
      }
    } else {
      const std::string file = (fs::path(method.maps) / (frame.name + ".png")).string();
      map_ = readDisparityPng(file);
      requireSizeOfLeftImage(file, map_, frame.size);
    }
    for (const auto& [kind, truth] : frame.ground_truth) {
      figures.scores[kind] = scoreDisparity(map_, KITTI_PNG_RANGE, truth);
    }
    if (!options_.write_maps.empty()) {
      writeDisparityPng(fileOf(options_.write_maps, method, frame), map_, KITTI_PNG_RANGE);
    }
    return figures;
  }

  void match(const LoadedFrame& frame, const StageParameters& parameters) {
    if (matched_ != nullptr && matched_->hasSameMatching(parameters)) return;
    matched_ = nullptr;
    matcher_.setParameters(parameters.matching());
    matching_ms_ = timed([&] {
      matcher_.compute(frame.left, frame.right, disparity_, frame.geometry.principal_point_offset);
    });
    matched_ = &parameters;
  }

  void refine(const LoadedFrame& frame, const EvaluatedMethod& method, EvaluationFigures& figures) {
    const StageParameters& parameters = method.parameters;
    if (segmented_ == nullptr || !segmented_->hasSameSegmentation(parameters)) {
      segmented_ = nullptr;
      const SegmentationParameters segmentation_parameters = parameters.segmentation();
      segmentation_ms_ =
          timed([&] { segments_ = segmentation_.compute(frame.left, segmentation_parameters, labels_); });
      segmented_ = &parameters;
    }
    figures.segments = segments_;
    figures.ms.segmentation = segmentation_ms_;

    const StereoGeometry& geometry = frame.geometry;
    const DisparityRange range = matcher_.range(geometry.principal_point_offset);
    RefinementParameters refinement_parameters = parameters.refinement();
    refinement_parameters.quality = method.quality;
    cv::Mat refined;
    figures.ms.refinement = timed([&] {
      refinement_.refine(disparity_, labels_, frame.left, range, geometry.focal_length * geometry.baseline,
                         refinement_parameters, refined);
    });
    map_ = roundToKittiPng(refined, range);
    if (options_.confidence) {
      findSources(disparity_, refined, labels_, range, refinement_.fittedPlanes(), sources_);
      findConfidence(sources_, confidence_);
      figures.confidence.add(refined, sources_, confidence_, frame.ground_truth.begin()->second);
    }
    if (options_.pictures.empty()) return;

    RefinementPicture picture;
    picture.image = frame.left;
    picture.labels = labels_;
    picture.disparity = disparity_;
    picture.refined = refined;
    picture.disparity_range = picture.refined_range = range;
    picture.ground_truth = frame.ground_truth.begin()->second;
    picture.disparity_title = matcherName(matcher_.parameters());
    picture.refined_title = method.name;
    writeImageFile(fileOf(options_.pictures, method, frame), drawRefinement(picture));
  }

  static std::string fileOf(const std::string& folder, const EvaluatedMethod& method,
                            const LoadedFrame& frame) {
    return (fs::path(folder) / folderName(method.name) / (frame.name + ".png")).string();
  }

  const std::vector<EvaluatedMethod>& methods_;
  const EvaluationOptions& options_;
  bool with_images_ = true;

  StereoMatcher matcher_;
  Segmentation segmentation_;
  DisparityRefinement refinement_;
  /// Parameters of what disparity_ and labels_ hold for this frame; null: nothing yet.
  const StageParameters *matched_ = nullptr, *segmented_ = nullptr;
  cv::Mat disparity_, labels_, map_, sources_, confidence_;
  int segments_ = 0;
  double matching_ms_ = 0.0, segmentation_ms_ = 0.0;
};

/// Refuses before the first frame what would fail in every one.
void validate(const std::vector<EvaluatedMethod>& methods, const EvaluationOptions& options) {
  requireArgument(options.threads >= 1, "threads", options.threads, "at least 1");
  std::set<std::string> folders;
  for (const EvaluatedMethod& method : methods) {
    if (!folders.insert(folderName(method.name)).second) {
      throw std::invalid_argument("two methods are called " + method.name);
    }
    if (!method.isComputed()) {
      if (!fs::is_directory(method.maps)) throw std::runtime_error(method.maps + ": no such folder of maps");
      continue;
    }
    method.parameters.matching();
    if (!method.isRefined()) continue;
    method.parameters.segmentation();
    method.parameters.refinement();
  }
}

void makeFolders(const std::string& folder, const std::vector<EvaluatedMethod>& methods, bool only_refined) {
  if (folder.empty()) return;
  for (const EvaluatedMethod& method : methods) {
    if (only_refined && !method.isRefined()) continue;
    const fs::path path = fs::path(folder) / folderName(method.name);
    std::error_code error;
    fs::create_directories(path, error);
    if (error) throw std::runtime_error("cannot make the folder " + path.string() + ": " + error.message());
  }
}

/// Sets the number of threads that OpenCV uses, until the end of the scope.
class OpenCvThreads {
 public:
  explicit OpenCvThreads(int threads) : before_(cv::getNumThreads()) { cv::setNumThreads(threads); }
  ~OpenCvThreads() { cv::setNumThreads(before_); }
  OpenCvThreads(const OpenCvThreads&) = delete;
  OpenCvThreads& operator=(const OpenCvThreads&) = delete;

 private:
  int before_;
};

}  // namespace

void ConfidenceFigures::add(const cv::Mat& refined, const cv::Mat& sources, const cv::Mat& confidence,
                            const cv::Mat& truth) {
  for (int y = 0; y < truth.rows; ++y) {
    for (int x = 0; x < truth.cols; ++x) {
      const int source = sources.at<std::uint8_t>(y, x);
      const float expected = truth.at<float>(y, x);
      if (expected <= 0.0F || source == static_cast<int>(DisparitySource::NONE)) continue;
      const bool is_wrong = std::abs(refined.at<float>(y, x) - expected) > WRONG;
      for (Count* count :
           {&by_source.at(source), &by_confidence[confidence.at<std::uint8_t>(y, x) * BINS / 256]}) {
        ++count->pixels;
        count->wrong += is_wrong ? 1 : 0;
      }
    }
  }
}

void ConfidenceFigures::add(const ConfidenceFigures& other) {
  const auto addAll = [](auto& sums, const auto& counts) {
    for (std::size_t i = 0; i < sums.size(); ++i) {
      sums[i].pixels += counts[i].pixels;
      sums[i].wrong += counts[i].wrong;
    }
  };
  addAll(by_source, other.by_source);
  addAll(by_confidence, other.by_confidence);
}

EvaluationFigures Evaluation::mean(std::size_t method) const {
  EvaluationFigures mean;
  std::map<std::string, KittiScoreMean> scores;
  const double weight = 1.0 / static_cast<double>(std::max<std::size_t>(frames.size(), 1));
  for (const EvaluationFigures& frame : figures.at(method)) {
    for (const auto& [kind, score] : frame.scores) scores[kind].add(score);
    mean.segments += weight * frame.segments;
    mean.ms.matching += weight * frame.ms.matching;
    mean.ms.segmentation += weight * frame.ms.segmentation;
    mean.ms.refinement += weight * frame.ms.refinement;
    mean.confidence.add(frame.confidence);
  }
  for (const auto& [kind, sum] : scores) mean.scores[kind] = sum.mean();
  return mean;
}

Evaluation evaluate(const std::vector<KittiFrame>& frames, const std::vector<EvaluatedMethod>& methods,
                    const EvaluationOptions& options, const std::function<void(int, int)>& progress) {
  validate(methods, options);
  makeFolders(options.write_maps, methods, false);
  makeFolders(options.pictures, methods, true);
  // The frames run beside each other; a stage has one thread, whose time is what is told.
  const OpenCvThreads one_thread(1);

  struct Outcome {
    std::vector<EvaluationFigures> figures;
    std::string error;
  };
  std::vector<Outcome> outcomes(frames.size());
  std::atomic<std::size_t> next{0};
  std::atomic<bool> stop{false};
  std::mutex progress_mutex;
  int done = 0;
  const auto work = [&] {
    FrameEvaluator evaluator(methods, options);
    for (std::size_t i = next++; i < frames.size() && !stop; i = next++) {
      try {
        outcomes[i].figures = evaluator.evaluate(frames[i]);
      } catch (const std::exception& error) {
        outcomes[i].error = "frame " + frames[i].name + ": " + error.what();
        if (!options.keep_going) stop = true;
      }
      const std::lock_guard<std::mutex> lock(progress_mutex);
      progress(++done, static_cast<int>(frames.size()));
    }
  };
  const std::size_t workers = std::min(static_cast<std::size_t>(options.threads), frames.size());
  std::vector<std::thread> threads;
  for (std::size_t i = 1; i < workers; ++i) threads.emplace_back(work);
  work();
  for (std::thread& thread : threads) thread.join();

  Evaluation evaluation;
  evaluation.methods = methods;
  evaluation.figures.resize(methods.size());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    Outcome& outcome = outcomes[i];
    if (!outcome.error.empty()) {
      if (!options.keep_going) throw std::runtime_error(outcome.error);
      evaluation.left_out.push_back(outcome.error);
      continue;
    }
    evaluation.frames.push_back(frames[i].name);
    for (std::size_t m = 0; m < methods.size(); ++m) {
      evaluation.figures[m].push_back(std::move(outcome.figures[m]));
    }
  }
  if (evaluation.frames.empty()) {
    throw std::runtime_error("no frame could be scored" +
                             (evaluation.left_out.empty() ? "" : ": " + evaluation.left_out.front()));
  }
  return evaluation;
}

std::string folderName(const std::string& method) {
  static const std::string KEPT = "+-.,=";
  std::string name;
  for (const char c : method) {
    if (std::isalnum(static_cast<unsigned char>(c)) != 0 || KEPT.find(c) != std::string::npos) {
      name += c;
    } else if (!name.empty() && name.back() != '_') {
      name += '_';
    }
  }
  while (!name.empty() && name.back() == '_') name.pop_back();
  return name;
}

}  // namespace disparity_refinement
