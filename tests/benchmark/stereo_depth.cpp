// Semi-global matching beside OpenCV's StereoSGBM (3-way, 64 disparities) in one process: CPU time of this
// thread, the two in turns, and the share of pixels whose disparity is wrong or missing. Real pairs with true
// disparity and rendered flights; data through SWIFTLET_DATA.
//   benchmark_stereo_depth [FOLDER]      pictures of disparities and errors go to FOLDER
// StereoSGBM runs with block sizes 3, 5, 7 and 9, with its filters and without (without, fewer are missing);
// of these the row shows the one with the least error on the group of sets, chosen for it afterwards. Ours:
// as delivered, and dense, without left-right check and speckle filter.

#include <algorithm>
#include <array>
#include <cstdio>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "mapping/depth/semi_global_matcher.hpp"
#include "mapping/depth/stereo_rectification.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/mapping/depth_sets.hpp"
#include "tests/support/cpu_time.hpp"

using namespace swiftlet;
using namespace swiftlet::depth_sets;

namespace {

constexpr int kRounds = 7;
constexpr std::size_t kRenderedPairs = 15;

ImageView viewOf(const cv::Mat& image) {
  return {image.data, image.cols, image.rows, static_cast<int>(image.step)};
}

struct Variant {
  int block = 0;
  bool filters = false;
};
const std::array<Variant, 8> kVariants = {
    {{3, false}, {5, false}, {7, false}, {9, false}, {3, true}, {5, true}, {7, true}, {9, true}}};

cv::Ptr<cv::StereoSGBM> makeSgbm(const Variant& v) {
  const int area = v.block * v.block;
  return cv::StereoSGBM::create(0, 64, v.block, 8 * area, 32 * area, v.filters ? 1 : -1, 63,
                                v.filters ? 10 : 0, v.filters ? 100 : 0, 2, cv::StereoSGBM::MODE_SGBM_3WAY);
}

struct Row {
  DisparityScore delivered, dense, dense_inner;
  std::array<DisparityScore, kVariants.size()> sgbm, sgbm_inner;
  double our_ms = 0;
  double sgbm_ms = 0;
};

double median(std::vector<double> all) {
  std::sort(all.begin(), all.end());
  return all[all.size() / 2];
}

Row measure(const StereoSet& set, const std::string& folder) {
  SemiGlobalMatcher matcher(set.left.cols, set.left.rows);
  MatcherSettings unfiltered;
  unfiltered.left_right_tolerance = -1;
  unfiltered.speckle_pixels = 0;
  SemiGlobalMatcher dense(set.left.cols, set.left.rows, unfiltered);
  DisparityImage ours(set.left.cols, set.left.rows), all(set.left.cols, set.left.rows);
  Row row;
  cv::Mat fixed, theirs;
  for (std::size_t i = 0; i < kVariants.size(); ++i) {
    makeSgbm(kVariants[i])->compute(set.left, set.right, fixed);
    fixed.convertTo(theirs, CV_32F, 1 / 16.0);
    row.sgbm[i] = score(theirs, {}, set.truth);
    row.sgbm_inner[i] = score(theirs, {}, set.truth, 64);
  }
  const auto timed_sgbm = makeSgbm({5, false});
  std::vector<double> our_times, sgbm_times;
  for (int round = 0; round < kRounds; ++round) {
    our_times.push_back(
        test::timed([&] { (void)matcher.match(viewOf(set.left), viewOf(set.right), 0, ours); }));
    sgbm_times.push_back(test::timed([&] { timed_sgbm->compute(set.left, set.right, fixed); }));
  }
  (void)dense.match(viewOf(set.left), viewOf(set.right), 0, all);
  row.delivered = score(disparityOf(ours), sigmaOf(ours), set.truth);
  row.dense = score(disparityOf(all), {}, set.truth);
  row.dense_inner = score(disparityOf(all), {}, set.truth, 64);
  row.our_ms = median(our_times);
  row.sgbm_ms = median(sgbm_times);
  if (!folder.empty()) {
    std::string name = set.name;
    std::replace(name.begin(), name.end(), ' ', '_');
    cv::imwrite(folder + "/" + name + ".png", drawDisparity(disparityOf(ours), set));
  }
  return row;
}

/// Means over a group of sets, as one line.
void print(const std::string& name, const std::vector<Row>& rows) {
  if (rows.empty()) return;
  const auto mean = [&](const auto& value) {
    double sum = 0;
    for (const Row& r : rows) sum += value(r);
    return sum / static_cast<double>(rows.size());
  };
  std::size_t best = 0;
  const auto error = [&](std::size_t i) {
    return mean([i](const Row& r) { return r.sgbm[i].wrong_or_missing; });
  };
  for (std::size_t i = 1; i < kVariants.size(); ++i) best = error(i) < error(best) ? i : best;
  const double ours = mean([](const Row& r) { return r.our_ms; });
  const double theirs = mean([](const Row& r) { return r.sgbm_ms; });
  std::printf(
      "%-28s %6.2f %6.2f %6.2f | %6.2f (block %d%s) %6.2f | %5.2f %5.3f %+6.3f | %4.1f %4.1f %4.1f | %5.1f "
      "%5.1f  %.2f\n",
      name.c_str(), 100 * mean([](const Row& r) { return r.delivered.wrong_or_missing; }),
      100 * mean([](const Row& r) { return r.dense.wrong_or_missing; }),
      100 * mean([](const Row& r) { return r.dense_inner.wrong_or_missing; }), 100 * error(best),
      kVariants[best].block, kVariants[best].filters ? ", filters" : "",
      100 * mean([&](const Row& r) { return r.sgbm_inner[best].wrong_or_missing; }),
      100 * mean([](const Row& r) { return r.delivered.wrong; }),
      mean([](const Row& r) { return r.delivered.mean_error; }),
      mean([](const Row& r) { return r.delivered.bias; }),
      100 * mean([](const Row& r) { return r.delivered.within_sigma[0]; }),
      100 * mean([](const Row& r) { return r.delivered.within_sigma[1]; }),
      100 * mean([](const Row& r) { return r.delivered.within_sigma[2]; }), ours, theirs, ours / theirs);
}

void timeRectification(const std::string& log, const StereoSet& set) {
  const auto folder = findLog(log);
  if (!folder) return;
  const StereoRectification rectification(readCalibration(*folder).rig);
  std::vector<std::uint8_t> out(rectification.intrinsics().pixels());
  std::vector<double> times;
  for (int round = 0; round < kRounds; ++round) {
    times.push_back(test::timed([&] {
      (void)rectification.warp(0).warp(viewOf(set.left), out.data());
      (void)rectification.warp(1).warp(viewOf(set.right), out.data());
    }));
  }
  std::printf("rectification of both images: %.2f ms\n", median(times));
}

}  // namespace

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  const std::string folder = argc > 1 ? argv[1] : "";
  std::printf(
      "wrong by more than 2 px or missing [%%], of pixels with a true disparity of at most 63 px; inner: "
      "without the 64 columns that StereoSGBM leaves out\n");
  std::printf("%-28s %6s %6s %6s | %-26s %6s | %5s %5s %6s | %-14s | %5s %5s ratio\n", "set", "ours", "dense",
              "inner", "StereoSGBM's best", "inner", "wrong", "|e|", "bias", "in 1,2,3 sigma", "ms", "ms");
  std::vector<Row> real;
  for (const StereoSet& set : realSets()) {
    real.push_back(measure(set, folder));
    print(set.name, {real.back()});
  }
  print("all real", real);
  for (const char* log : {"vil_v102", "vil_mh05"}) {
    std::vector<Row> rendered;
    const std::vector<StereoSet> sets = renderedSets(log, kRenderedPairs);
    for (const StereoSet& set : sets)
      rendered.push_back(measure(set, rendered.size() % 5 == 0 ? folder : ""));
    print(log, rendered);
    if (!sets.empty()) timeRectification(log, sets.front());
  }
}
