// Place recognition on real revisits beside OpenCV's ORB; run by hand, prints figures.

#include <algorithm>
#include <cstdio>
#include <memory>

#include "tests/mapping/place_scene.hpp"
#include "tests/support/cpu_time.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

struct Quality {
  std::size_t right = 0, judged = 0, mutual = 0, found_again = 0, visible = 0;
  std::vector<std::pair<double, bool>> by_score;  // matches that look good, whether revisit
  double seconds = 0;
};

constexpr double kTolerance = 6.0;  // px at octave 0: depth and colour are registered to some 2 px
constexpr int kGoodDistance = 64;

void judge(const Kitchen& kitchen, const std::vector<Described>& all, Quality& q) {
  for (const PairTruth& pair : kitchen.pairs) {
    const bool revisit = isRevisit(pair);
    if (!revisit && !isNegative(pair)) continue;
    const Described& a = all[pair.i];
    const Described& b = all[pair.j];
    const auto matches = mutualMatches(a.descriptor, b.descriptor);
    std::size_t good = 0;
    for (const MutualMatch& m : matches) good += m.distance <= kGoodDistance ? 1U : 0U;
    q.by_score.push_back({static_cast<double>(good), revisit});
    if (!revisit) continue;
    const auto near = [&](const Eigen::Vector2d& to, std::size_t at) {
      const double scale = std::pow(1.2, b.octave[at]);
      return (to - b.pixel[at]).norm() < kTolerance * std::max(1.0, 0.5 * scale);
    };
    for (const MutualMatch& m : matches) {
      Eigen::Vector2d to;
      q.mutual += m.distance <= kGoodDistance ? 1U : 0U;
      if (m.distance > kGoodDistance || !kitchen.transfer(pair.i, a.pixel[m.first], pair.j, to)) continue;
      ++q.judged;
      if (near(to, m.second)) ++q.right;
    }
    for (std::size_t i = 0; i < a.pixel.size(); ++i) {
      Eigen::Vector2d to;
      if (!kitchen.transfer(pair.i, a.pixel[i], pair.j, to)) continue;
      ++q.visible;
      bool again = false;
      for (std::size_t k = 0; k < b.pixel.size() && !again; ++k) again = near(to, k);
      q.found_again += again ? 1U : 0U;
    }
  }
}

double averagePrecision(std::vector<std::pair<double, bool>> scores) {
  std::stable_sort(scores.begin(), scores.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  double sum = 0;
  std::size_t right = 0, all = 0;
  for (const auto& s : scores) {
    ++all;
    if (!s.second) continue;
    ++right;
    sum += static_cast<double>(right) / static_cast<double>(all);
  }
  return right > 0 ? sum / static_cast<double>(right) : 0;
}

void print(const char* name, const Quality& q, std::size_t pairs) {
  std::printf(
      "%-22s correct matches a pair %6.1f of %6.1f good ones judged (%.1f %%), repeatability %.3f, AP %.4f, "
      "%.2f ms an image\n",
      name, static_cast<double>(q.right) / static_cast<double>(pairs),
      static_cast<double>(q.judged) / static_cast<double>(pairs),
      100.0 * static_cast<double>(q.right) / static_cast<double>(q.judged),
      static_cast<double>(q.found_again) / static_cast<double>(q.visible), averagePrecision(q.by_score),
      q.seconds);
}

void kitchenFeatures(const Kitchen& kitchen) {
  std::size_t revisits = 0;
  for (const PairTruth& p : kitchen.pairs) revisits += isRevisit(p) ? 1U : 0U;
  for (const int features : {400, 500}) {
    PlaceExtractorSettings settings;
    settings.features = features;
    const cv::Mat& first = kitchen.grey[0];
    PlaceExtractor extractor(first.cols, first.rows, settings);
    const CameraModel camera = plainCamera(first.cols, first.rows);
    auto keyframe = std::make_unique<PlaceKeyframe>();
    std::vector<Described> ours, theirs, mixed;
    Quality q_ours, q_theirs, q_mixed;
    for (const cv::Mat& image : kitchen.grey) {
      q_ours.seconds +=
          test::timed([&] { ours.push_back(describeOurs(extractor, camera, image, *keyframe)); });
      q_theirs.seconds += test::timed([&] { theirs.push_back(describeOpenCv(image, features)); });
    }
    for (const cv::Mat& image : kitchen.grey) mixed.push_back(describeAtOpenCvs(image, features));
    judge(kitchen, mixed, q_mixed);
    q_ours.seconds /= static_cast<double>(kitchen.grey.size());
    q_theirs.seconds /= static_cast<double>(kitchen.grey.size());
    judge(kitchen, ours, q_ours);
    judge(kitchen, theirs, q_theirs);
    std::printf("redkitchen_50, %zu revisits, %d features (%zu, %zu in the first image)\n", revisits,
                features, ours[0].pixel.size(), theirs[0].pixel.size());
    print("  ours", q_ours, revisits);
    print("  ours at ORB's corners", q_mixed, revisits);
    print("  OpenCV ORB", q_theirs, revisits);
  }
}

}  // namespace

int main() {
  cv::setNumThreads(1);
  const Kitchen kitchen = readKitchen();
  if (kitchen.grey.empty()) {
    std::fprintf(stderr, "no data: set SWIFTLET_DATA\n");
    return 1;
  }
  kitchenFeatures(kitchen);
  return 0;
}
