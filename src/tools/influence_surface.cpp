// The influence of lambda and h on the number of segments: the paper's Figure 5.

#include <sys/wait.h>

#include <array>
#include <csignal>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <sstream>
#include <stdexcept>
#include <vector>

#include "CommandLine.hpp"
#include "OutputFiles.hpp"
#include "StageParameters.hpp"
#include "disparity_refinement/arguments.hpp"
#include "disparity_refinement/evaluation/KittiFiles.hpp"
#include "disparity_refinement/visualization/Colorize.hpp"
#include "disparity_refinement/visualization/Panels.hpp"

namespace disparity_refinement {
namespace {

namespace po = boost::program_options;
namespace fs = std::filesystem;

constexpr const char* USAGE =
    R"(Usage: influence_surface IMAGE [options]

Counts the segments of an image for lambda = 0 ... 160 and h = 0 ... 60, all of them from
one tree, and writes
  surface.csv    lambda, h, segments
  surface.png    the surface in 3-D, with the paper's three settings marked (by gnuplot)
  segments.png   the segmentations of the three settings
)";

/// A setting (lambda, h), and its segmentation.
struct Mark {
  int lambda, h;
  int segments = 0;
  cv::Mat labels;

  std::string text() const {
    return "(" + std::to_string(lambda) + ", " + std::to_string(h) + "): " + std::to_string(segments) +
           " segments";
  }
};

/// The settings of the paper's Figure 5.
std::array<Mark, 3> paperMarks() { return {Mark{5, 2, 0, {}}, Mark{30, 5, 0, {}}, Mark{80, 15, 0, {}}}; }

std::string csv(const cv::Mat& surface) {
  std::ostringstream text;
  text << "lambda,h,segments\n";
  for (int lambda = 0; lambda < surface.rows; ++lambda) {
    for (int h = 0; h < surface.cols; ++h) {
      text << lambda << "," << h << "," << surface.at<std::int32_t>(lambda, h) << "\n";
    }
  }
  return text.str();
}

/// What gnuplot draws the surface with. The counts span four decades, hence the logarithmic axis.
std::string gnuplotScript(const cv::Mat& surface, const std::array<Mark, 3>& marks) {
  // Of their own, or gnuplot fails on a flat surface.
  double smallest = 0.0, largest = 0.0;
  cv::minMaxLoc(surface, &smallest, &largest);
  std::ostringstream script;
  script << "$surface << END\n";
  for (int lambda = 0; lambda < surface.rows; ++lambda) {
    for (int h = 0; h < surface.cols; ++h) {
      script << lambda << " " << h << " " << surface.at<std::int32_t>(lambda, h) << "\n";
    }
    script << "\n";
  }
  script << "END\n";
  for (const Mark& mark : marks) {
    // Labels in front, or the surface would hide them.
    script << "set label '" << mark.text() << "' at " << mark.lambda << "," << mark.h << "," << mark.segments
           << " front point pointtype 7 pointsize 1.5 linecolor 'red' offset 1.2,0.8\n";
  }
  script << "set terminal pngcairo size 1100,800 noenhanced font 'Sans,12'\n"
            "set output\n"
            "set logscale z\n"
            "set logscale cb\n"
            "set palette defined (0 '#30123b', 1 '#4777ef', 2 '#1bcfd4', 3 '#95fb51', 4 '#edd03a', 5 "
            "'#e4460a')\n"
            "set xlabel 'lambda [px]'\n"
            "set ylabel 'h [gray levels]'\n"
            "set zlabel 'segments' rotate parallel\n"
            "set xrange [0:"
         << surface.rows - 1 << "]\nset yrange [0:" << surface.cols - 1
         << "]\n"
            "set zrange ["
         << 0.9 * smallest << ":" << 1.1 * largest << "]\nset cbrange [" << 0.9 * smallest << ":"
         << 1.1 * largest
         << "]\n"
            "set ticslevel 0\n"
            "set view 50, 140\n"
            "set grid x y z\n"
            "set key off\n"
            "splot $surface with pm3d\n";
  return script.str();
}

/// The PNG that gnuplot makes of a script.
void plot(const std::string& script, const std::string& file) {
  // A gnuplot that ends early must not end this program too.
  std::signal(SIGPIPE, SIG_IGN);
  const fs::path temporary = file + ".part";
  std::string quoted = "'";
  for (const char c : temporary.string()) quoted += c == '\'' ? std::string("'\\''") : std::string(1, c);
  std::FILE* pipe = popen(("gnuplot > " + quoted + "'").c_str(), "w");
  if (pipe == nullptr) throw std::runtime_error("cannot start gnuplot");
  const bool is_written = std::fwrite(script.data(), 1, script.size(), pipe) == script.size();
  const int status = pclose(pipe);
  if (!is_written || status != 0 || fs::file_size(temporary) == 0) {
    fs::remove(temporary);
    throw std::runtime_error(WIFEXITED(status) && WEXITSTATUS(status) == 127
                                 ? "gnuplot is not installed (package gnuplot-nox): no " + file
                                 : "gnuplot has failed: no " + file);
  }
  fs::rename(temporary, file);
}

cv::Mat drawSegmentations(const cv::Mat& gray, const std::array<Mark, 3>& marks) {
  std::vector<Panel> panels{{"image", gray}};
  for (const Mark& mark : marks) {
    Panel panel{mark.text(), {}};
    drawSegmentBorders(gray, mark.labels, panel.picture);
    panels.push_back(panel);
  }
  return arrangePanels(panels, 2);
}

void run(int argc, char** argv) {
  std::string folder = ".";
  int max_lambda = 160, max_h = 60;
  po::options_description description("Options");
  description.add_options()("output,o", po::value(&folder)->value_name("DIR")->default_value(folder),
                            "where to")("max-lambda", po::value(&max_lambda)->default_value(max_lambda),
                                        "largest lambda [px], 80 ... 1000")(
      "max-h", po::value(&max_h)->default_value(max_h), "largest h [gray levels], 15 ... 255");
  po::options_description parameter_options("Parameters, as for the nodelet");
  StageParameters::addSegmentationOptions(parameter_options);
  description.add(parameter_options);
  po::variables_map values;
  if (!parseCommandLine(argc, argv, USAGE, {"IMAGE"}, description, values)) return;
  std::array<Mark, 3> marks = paperMarks();
  requireArgument(max_lambda >= marks.back().lambda && max_lambda <= 1000, "max-lambda", max_lambda,
                  "80 ... 1000");
  requireArgument(max_h >= marks.back().h && max_h <= 255, "max-h", max_h, "15 ... 255");
  StageParameters parameters;
  parameters.readOptions(values);
  SegmentationParameters segmentation_parameters = parameters.segmentation();
  const cv::Mat gray = readGrayImage(values["IMAGE"].as<std::string>());

  Segmentation segmentation;
  for (Mark& mark : marks) {
    segmentation_parameters.lambda = mark.lambda;
    segmentation_parameters.h = mark.h;
    mark.segments = segmentation.compute(gray, segmentation_parameters, mark.labels);
  }
  const cv::Mat surface = segmentation.countSurface(gray, segmentation_parameters, max_lambda, max_h);

  fs::create_directories(folder);
  const auto file = [&folder](const char* name) { return (fs::path(folder) / name).string(); };
  writeTextFile(file("surface.csv"), csv(surface));
  writeImageFile(file("segments.png"), drawSegmentations(gray, marks));
  for (const Mark& mark : marks) std::cout << mark.text() << "\n";
  plot(gnuplotScript(surface, marks), file("surface.png"));
}

}  // namespace
}  // namespace disparity_refinement

int main(int argc, char** argv) {
  return disparity_refinement::runTool("influence_surface", [&] { disparity_refinement::run(argc, argv); });
}
