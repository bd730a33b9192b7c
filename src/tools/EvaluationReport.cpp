#include "EvaluationReport.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <ostream>

#include "Format.hpp"
#include "OutputFiles.hpp"

namespace disparity_refinement {
namespace {

using Json = nlohmann::json;

std::string padded(const std::string& text, std::size_t width) {
  return text + std::string(width - std::min(width, text.size()), ' ');
}

std::string cells(const DisparityErrors& errors) {
  std::string text = "  |";
  for (const double outliers : errors.outliers) text += format(" %6.2f", 100.0 * outliers);
  return text + format(" %6.3f", errors.end_point_error);
}

Json toJson(const DisparityErrors& errors) {
  Json json;
  for (std::size_t i = 0; i < errors.outliers.size(); ++i) {
    json[std::to_string(i + 1)] = 100.0 * errors.outliers[i];
  }
  json["epe"] = errors.end_point_error;
  return json;
}

Json parametersOf(const EvaluatedMethod& method) {
  Json json = Json::object();
  if (!method.isComputed()) return json;
  const StageParameters& parameters = method.parameters;
  for (const auto& [name, value] : method.isRefined() ? parameters.values() : parameters.matchingValues()) {
    std::visit([&json, &name = name](auto v) { json[name] = v; }, value);
  }
  return json;
}

/// (what is said of a disparity, how often it is said and wrong), in the order of the tables.
std::vector<std::pair<std::string, ConfidenceFigures::Count>> countsOf(const ConfidenceFigures& figures) {
  std::vector<std::pair<std::string, ConfidenceFigures::Count>> counts;
  for (int i = static_cast<int>(DisparitySource::MEASURED); i < DISPARITY_SOURCES; ++i) {
    counts.emplace_back(toString(static_cast<DisparitySource>(i)), figures.by_source[i]);
  }
  constexpr int LEVELS = 256 / ConfidenceFigures::BINS;
  for (int i = ConfidenceFigures::BINS - 1; i >= 0; --i) {
    counts.emplace_back(format("confidence %d-%d", i * LEVELS, (i + 1) * LEVELS - 1),
                        figures.by_confidence[i]);
  }
  return counts;
}

long pixelsOf(const ConfidenceFigures& figures) {
  long pixels = 0;
  for (const ConfidenceFigures::Count& count : figures.by_source) pixels += count.pixels;
  return pixels;
}

double percentage(long part, long whole) {
  return whole > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

Json toJson(const ConfidenceFigures& figures) {
  Json json = Json::object();
  for (const auto& [name, count] : countsOf(figures)) {
    json[name] = {{"share", percentage(count.pixels, pixelsOf(figures))},
                  {"wrong", percentage(count.wrong, count.pixels)}};
  }
  return json;
}

void printConfidence(const std::string& method, const ConfidenceFigures& figures, std::ostream& out) {
  const auto counts = countsOf(figures);
  long wrong = 0;
  for (const ConfidenceFigures::Count& count : figures.by_source) wrong += count.wrong;
  out << "\n"
      << method << ", disparities of all frames  share [%]  wrong by more than 3 px [%]  of all errors [%]\n";
  for (const auto& [name, count] : counts) {
    out << padded("  " + name, method.size() + 27)
        << format("  %9.2f  %27.2f  %17.1f\n", percentage(count.pixels, pixelsOf(figures)),
                  percentage(count.wrong, count.pixels), percentage(count.wrong, wrong));
  }
}

Json toJson(const EvaluatedMethod& method, const EvaluationFigures& mean, std::size_t frames) {
  Json json;
  json["name"] = method.name;
  json["frames"] = frames;
  json["parameters"] = parametersOf(method);
  json["segments"] = method.isRefined() ? Json(mean.segments) : Json();
  const auto time = [&method](double ms) { return method.isComputed() ? Json(ms) : Json(); };
  json["ms"] = {{"matching", time(mean.ms.matching)},
                {"segmentation", time(mean.ms.segmentation)},
                {"refinement", time(mean.ms.refinement)},
                {"total", time(mean.ms.total())}};
  if (pixelsOf(mean.confidence) > 0) json["confidence"] = toJson(mean.confidence);
  for (const auto& [kind, score] : mean.scores) {
    json[kind] = {{"density", 100.0 * score.density}, {"all", toJson(score.all)}, {"est", toJson(score.est)}};
  }
  return json;
}

/// A field of a CSV file that may hold commas and quotes.
std::string quoted(const std::string& text) {
  std::string field = "\"";
  for (const char c : text) field += c == '"' ? std::string("\"\"") : std::string(1, c);
  return field + "\"";
}

std::string csvLines(const EvaluatedMethod& method, const std::string& frame,
                     const EvaluationFigures& figures) {
  std::string text;
  for (const auto& [kind, score] : figures.scores) {
    text += quoted(method.name) + "," + frame + "," + kind + format(",%.6f", 100.0 * score.density);
    for (const DisparityErrors& errors : {score.all, score.est}) {
      for (const double outliers : errors.outliers) text += format(",%.6f", 100.0 * outliers);
      text += format(",%.6f", errors.end_point_error);
    }
    text += method.isRefined() ? format(",%.2f", figures.segments) : ",";
    text += method.isComputed() ? format(",%.3f,%.3f,%.3f,%.3f", figures.ms.matching, figures.ms.segmentation,
                                         figures.ms.refinement, figures.ms.total())
                                : ",,,,";
    text += "\n";
  }
  return text;
}

}  // namespace

void printTables(const Evaluation& evaluation, std::ostream& out) {
  std::vector<EvaluationFigures> means;
  std::size_t width = 6;
  for (std::size_t m = 0; m < evaluation.methods.size(); ++m) {
    means.push_back(evaluation.mean(m));
    width = std::max(width, evaluation.methods[m].name.size());
  }
  for (const auto& entry : means.front().scores) {
    const std::string& kind = entry.first;
    out << "disp_" << kind << ", " << evaluation.frames.size()
        << " frames: mean of their rates of pixels wrong by more than 1 ... 5 px [%], end-point error [px]\n"
        << std::string(width, ' ')
        << "           | all, holes interpolated                    | est, without holes\n"
        << padded("method", width) << "  density";
    for (int column = 0; column < 2; ++column) out << "  |    > 1    > 2    > 3    > 4    > 5    epe";
    out << "\n";
    for (std::size_t m = 0; m < means.size(); ++m) {
      const KittiScore& score = means[m].scores.at(kind);
      out << padded(evaluation.methods[m].name, width) << format("  %7.2f", 100.0 * score.density)
          << cells(score.all) << cells(score.est) << "\n";
    }
    out << "\n";
  }

  out << padded("method", width) << "  segments  matching [ms]  segmentation  refinement    total\n";
  for (std::size_t m = 0; m < means.size(); ++m) {
    const EvaluatedMethod& method = evaluation.methods[m];
    const StageTimes& ms = means[m].ms;
    if (!method.isComputed()) continue;
    out << padded(method.name, width)
        << (method.isRefined() ? format("  %8.1f", means[m].segments) : format("  %8s", "-"))
        << format("  %13.1f  %12.1f  %10.1f  %7.1f\n", ms.matching, ms.segmentation, ms.refinement,
                  ms.total());
  }
  for (std::size_t m = 0; m < means.size(); ++m) {
    if (pixelsOf(means[m].confidence) == 0) continue;
    printConfidence(evaluation.methods[m].name, means[m].confidence, out);
  }
  if (!evaluation.left_out.empty()) {
    out << "\nLeft out, " << evaluation.left_out.size() << " frames:\n";
    for (const std::string& reason : evaluation.left_out) out << "  " << reason << "\n";
  }
}

void writeJson(const Evaluation& evaluation, const std::string& file) {
  Json json = Json::array();
  for (std::size_t m = 0; m < evaluation.methods.size(); ++m) {
    json.push_back(toJson(evaluation.methods[m], evaluation.mean(m), evaluation.frames.size()));
  }
  writeTextFile(file, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

void writeCsv(const Evaluation& evaluation, const std::string& file) {
  std::string text = "method,frame,ground_truth,density";
  for (const std::string kind : {"all", "est"}) {
    for (int tau = 1; tau <= 5; ++tau) text += "," + kind + "_" + std::to_string(tau);
    text += "," + kind + "_epe";
  }
  text += ",segments,matching_ms,segmentation_ms,refinement_ms,total_ms\n";
  for (std::size_t m = 0; m < evaluation.methods.size(); ++m) {
    const EvaluatedMethod& method = evaluation.methods[m];
    for (std::size_t i = 0; i < evaluation.frames.size(); ++i) {
      text += csvLines(method, evaluation.frames[i], evaluation.figures[m][i]);
    }
    text += csvLines(method, "mean", evaluation.mean(m));
  }
  writeTextFile(file, text);
}

}  // namespace disparity_refinement
