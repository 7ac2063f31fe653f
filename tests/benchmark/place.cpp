// Place recognition's cost: a keyframe's features beside OpenCV's ORB in one process, and a query among 2 000
// keyframes. Images of the recorded logs, one thread, CPU time of this thread.
//   benchmark_place            (logs through SWIFTLET_DATA)

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "mapping/place/place_database.hpp"
#include "mapping/place/place_extractor.hpp"
#include "mapping/place/vocabulary.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/cpu_time.hpp"

using namespace swiftlet;

namespace {

constexpr std::size_t kKeyframes = 2000;
constexpr int kFeatures = 400;
constexpr double kKeyframeInterval = 0.2;  // s

struct Times {
  std::vector<double> all;
  void print(const char* what) {
    std::sort(all.begin(), all.end());
    const auto at = [&](double share) {
      return all[static_cast<std::size_t>(share * static_cast<double>(all.size() - 1))];
    };
    std::printf("%-44s %5zu times  p50 %.3f  p99 %.3f  max %.3f ms\n", what, all.size(), at(0.5), at(0.99),
                all.back());
  }
};

std::vector<std::string> imageFiles() {
  std::vector<std::string> files;
  for (const char* log : {"euroc_mh01_20s", "vil_v102", "vil_mh05"}) {
    const auto folder = findLog(log);
    if (!folder) continue;
    for (const char* camera : {"/mav0/cam0/data", "/mav0/cam1/data"}) {
      const std::size_t first = files.size();
      for (const auto& entry : std::filesystem::directory_iterator(*folder + camera))
        files.push_back(entry.path().string());
      std::sort(files.begin() + static_cast<std::ptrdiff_t>(first), files.end());
    }
  }
  return files;
}

}  // namespace

int main() {
  cv::setNumThreads(1);
  const std::vector<std::string> files = imageFiles();
  if (files.empty()) return 1;
  const cv::Mat first = cv::imread(files[0], cv::IMREAD_GRAYSCALE);
  PlaceExtractorSettings extractor_settings;
  extractor_settings.features = kFeatures;
  PlaceExtractor extractor(first.cols, first.rows, extractor_settings);
  const CameraModel camera(CameraKind::kPinholeRadtan, first.cols, first.rows,
                           Eigen::Vector4d(458.654, 457.296, 367.215, 248.375),
                           Eigen::Vector4d(-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05));
  const Vocabulary& vocabulary = Vocabulary::shipped();
  PlaceDatabaseSettings settings;
  settings.keyframes = kKeyframes;
  PlaceDatabase database(vocabulary.words(), settings);
  const auto orb = cv::ORB::create(kFeatures);
  const auto keyframe = std::make_unique<PlaceKeyframe>();
  const auto bag = std::make_unique<BagOfWords>();
  const auto query = std::make_unique<PlaceQuery>();
  const TrackedFrame none;
  Times ours, theirs, words, asking, adding, asking_full, adding_full;
  std::vector<cv::KeyPoint> points;
  cv::Mat bits;
  // Twice the capacity: the second half asks and adds with the database full.
  for (std::size_t i = 0; i < 2 * kKeyframes; ++i) {
    const cv::Mat grey = cv::imread(files[i % files.size()], cv::IMREAD_GRAYSCALE);
    const ImageView view{grey.data, grey.cols, grey.rows, static_cast<int>(grey.step[0])};
    ours.all.push_back(test::timed([&] { (void)extractor.extract(view, camera, none, *keyframe); }));
    if (i % 10 == 0) {
      theirs.all.push_back(test::timed([&] { orb->detectAndCompute(grey, cv::noArray(), points, bits); }));
    }
    words.all.push_back(test::timed([&] { (void)vocabulary.describe(*keyframe, *bag); }));
    const Stamp now{static_cast<std::int64_t>(1e9 * kKeyframeInterval * static_cast<double>(i))};
    const bool full = i >= kKeyframes;
    std::uint32_t slot = 0;
    (full ? asking_full : asking).all.push_back(test::timed([&] {
      (void)database.query(now, 0, *bag, *query);
    }));
    (full ? adding_full : adding).all.push_back(test::timed([&] {
      (void)database.add(i, now, 0, *bag, slot);
    }));
  }
  std::printf("%zu images of %d x %d, %d features, %zu words, database of %zu keyframes in %.1f MB\n",
              files.size(), first.cols, first.rows, kFeatures, vocabulary.words(), database.capacity(),
              1e-6 * static_cast<double>(database.bytes()));
  ours.print("features and descriptors, ours");
  theirs.print("  OpenCV's ORB, detectAndCompute");
  words.print("words of a keyframe");
  asking.print("query, while the database fills");
  asking_full.print("query, 2 000 keyframes");
  adding.print("add, while the database fills");
  adding_full.print("add to the full database, one leaves");
  return 0;
}
