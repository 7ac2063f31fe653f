// Place recognition on real revisits beside OpenCV's ORB; run by hand, prints figures.

#include <algorithm>
#include <cstdio>
#include <memory>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "firmware_host/inputs/vocabulary/vocabulary_file.hpp"
#include "mapping/place/place_database.hpp"
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

// ---- Retrieval ----

struct Images {
  std::vector<PlaceKeyframe> keyframe;
  std::vector<BagOfWords> bag;
};

Images describeAll(const std::vector<cv::Mat>& images, const Vocabulary& vocabulary) {
  Images out;
  out.keyframe.resize(images.size());
  out.bag.resize(images.size());
  const cv::Mat& first = images[0];
  PlaceExtractor extractor(first.cols, first.rows);
  const CameraModel camera = plainCamera(first.cols, first.rows);
  for (std::size_t i = 0; i < images.size(); ++i) {
    (void)describeOurs(extractor, camera, images[i], out.keyframe[i]);
    (void)vocabulary.describe(out.keyframe[i], out.bag[i]);
  }
  return out;
}

// Inliers of a fundamental matrix: a stand-in for the verification that follows.
int inliers(const Described& a, const Described& b) {
  std::vector<cv::Point2f> from, to;
  for (const MutualMatch& m : mutualMatches(a.descriptor, b.descriptor)) {
    if (m.distance > kGoodDistance) continue;
    from.emplace_back(static_cast<float>(a.pixel[m.first].x()), static_cast<float>(a.pixel[m.first].y()));
    to.emplace_back(static_cast<float>(b.pixel[m.second].x()), static_cast<float>(b.pixel[m.second].y()));
  }
  if (from.size() < 8) return 0;
  cv::setRNGSeed(1);
  cv::Mat mask;
  constexpr double kPixels = 3, kConfidence = 0.999;
  cv::findFundamentalMat(from, to, cv::FM_RANSAC, kPixels, kConfidence, 2000, mask);
  return mask.empty() ? 0 : cv::countNonZero(mask);
}

void kitchenRetrieval(const Kitchen& kitchen, const Vocabulary& vocabulary, bool verify) {
  constexpr double kStep = 20 / 30.0;  // s between the frames of the set, taken at 30 Hz
  const Images images = describeAll(kitchen.grey, vocabulary);
  PlaceDatabaseSettings settings;
  settings.exclude = 9.5 * kStep;  // 200 frames and more are a revisit
  settings.candidates = kMaxPlaceCandidates;
  settings.per_island = kMaxPlaceCandidates;
  settings.min_relative = 0;
  PlaceDatabase database(vocabulary.words(), settings);
  std::vector<PlaceQuery> found(images.bag.size());
  for (std::size_t i = 0; i < images.bag.size(); ++i) {
    const Stamp stamp{static_cast<std::int64_t>(1e9 * kStep * static_cast<double>(i))};
    std::uint32_t slot = 0;
    (void)database.query(stamp, 0, images.bag[i], found[i]);
    (void)database.add(i, stamp, 0, images.bag[i], slot);
  }
  std::vector<bool> verified(kitchen.pairs.size(), false);
  std::size_t all_verified = 0;
  if (verify) {
    constexpr int kEnough = 20;
    std::vector<Described> orb;
    for (const cv::Mat& image : kitchen.grey) orb.push_back(describeOpenCv(image, 400));
    std::size_t wrong = 0;
    for (std::size_t p = 0; p < kitchen.pairs.size(); ++p) {
      const PairTruth& pair = kitchen.pairs[p];
      if (!isRevisit(pair) && !isNegative(pair)) continue;
      verified[p] = inliers(orb[pair.i], orb[pair.j]) >= kEnough;
      wrong += verified[p] && isNegative(pair) ? 1U : 0U;
      all_verified += verified[p] && isRevisit(pair) ? 1U : 0U;
    }
    std::printf(
        "  brute force of OpenCV's ORB and a fundamental matrix with %d inliers: %zu revisits, %zu "
        "negatives\n",
        kEnough, all_verified, wrong);
  }
  for (const std::size_t n : {1U, 3U, 5U, 10U, 15U, 20U}) {
    for (const float relative : {0.0F, 0.15F, 0.3F}) {
      std::size_t revisits = 0, right = 0, negatives = 0, false_ones = 0, of_verified = 0, given = 0;
      for (std::size_t p = 0; p < kitchen.pairs.size(); ++p) {
        const PairTruth& pair = kitchen.pairs[p];
        bool there = false;
        const auto& candidates = found[pair.j].candidates;
        for (std::size_t k = 0; k < std::min(n, candidates.size()); ++k) {
          there = there || (candidates[k].index == pair.i && candidates[k].relative >= relative);
        }
        given += there ? 1U : 0U;
        revisits += isRevisit(pair) ? 1U : 0U;
        right += isRevisit(pair) && there ? 1U : 0U;
        negatives += isNegative(pair) ? 1U : 0U;
        false_ones += isNegative(pair) && there ? 1U : 0U;
        of_verified += isRevisit(pair) && there && verified[p] ? 1U : 0U;
      }
      std::printf(
          "  %2zu candidates, relative %.2f: %3zu of %zu revisits, %3zu of %zu negatives, %zu of %zu "
          "verified, %zu given\n",
          n, static_cast<double>(relative), right, revisits, false_ones, negatives, of_verified, all_verified,
          given);
    }
  }
  std::vector<std::pair<double, bool>> scores, relative_scores;
  for (const PairTruth& pair : kitchen.pairs) {
    if (!isRevisit(pair) && !isNegative(pair)) continue;
    const double s = static_cast<double>(similarity(images.bag[pair.i], images.bag[pair.j]));
    scores.push_back({s, isRevisit(pair)});
    relative_scores.push_back(
        {s / std::max(0.02, static_cast<double>(found[pair.j].reference)), isRevisit(pair)});
  }
  std::printf("  AP of revisits against negatives: by score %.4f, relative %.4f\n", averagePrecision(scores),
              averagePrecision(relative_scores));
}

void corridorRetrieval(const Vocabulary& vocabulary) {
  const Corridor corridor = readCorridor();
  if (corridor.query.empty()) return;
  for (const int scale : {1, 2, 3}) {
    const auto enlarged = [scale](std::vector<cv::Mat> images) {
      for (cv::Mat& image : images) cv::resize(image, image, {}, scale, scale, cv::INTER_CUBIC);
      return images;
    };
    const auto query = enlarged(corridor.query), reference = enlarged(corridor.reference);
    const Images q = describeAll(query, vocabulary), r = describeAll(reference, vocabulary);
    PlaceDatabaseSettings settings;
    settings.min_relative = 0;
    settings.per_island = kMaxPlaceCandidates;
    PlaceDatabase database(vocabulary.words(), settings);
    for (std::size_t i = 0; i < r.bag.size(); ++i) {
      std::uint32_t slot = 0;
      (void)database.add(i, Stamp{static_cast<std::int64_t>(i * 100'000'000)}, 0, r.bag[i], slot);
    }
    std::vector<Described> orb_q, orb_r;
    for (const cv::Mat& image : query) orb_q.push_back(describeOpenCv(image, 400));
    for (const cv::Mat& image : reference) orb_r.push_back(describeOpenCv(image, 400));
    std::size_t at1 = 0, at5 = 0, orb1 = 0, orb5 = 0, features = 0, orb_features = 0, asked = 0;
    const auto is = [&](std::size_t query_index, std::size_t reference_index) {
      const auto& truth = corridor.truth[query_index];
      return std::find(truth.begin(), truth.end(), reference_index) != truth.end();
    };
    for (std::size_t i = 0; i < q.bag.size(); ++i) {
      if (corridor.truth[i].empty()) continue;
      ++asked;
      PlaceQuery found;
      (void)database.query(Stamp{static_cast<std::int64_t>((1000 + i) * 100'000'000)}, 1, q.bag[i], found);
      features += q.keyframe[i].features.size();
      orb_features += orb_q[i].pixel.size();
      bool hit = false;
      for (std::size_t k = 0; k < std::min<std::size_t>(5, found.candidates.size()); ++k) {
        hit = hit || is(i, static_cast<std::size_t>(found.candidates[k].index));
        if (k == 0 && hit) ++at1;
      }
      at5 += hit ? 1U : 0U;
      std::vector<std::pair<int, std::size_t>> ranked;
      for (std::size_t k = 0; k < orb_r.size(); ++k) {
        int good = 0;
        for (const MutualMatch& m : mutualMatches(orb_q[i].descriptor, orb_r[k].descriptor))
          good += m.distance <= kGoodDistance ? 1 : 0;
        ranked.push_back({-good, k});
      }
      std::sort(ranked.begin(), ranked.end());
      hit = false;
      for (std::size_t k = 0; k < 5; ++k) {
        hit = hit || is(i, ranked[k].second);
        if (k == 0 && hit) ++orb1;
      }
      orb5 += hit ? 1U : 0U;
    }
    const auto share = [&](std::size_t count) {
      return static_cast<double>(count) / static_cast<double>(asked);
    };
    std::printf(
        "corridor, images enlarged %d times: recall at 1 / 5: words %.3f / %.3f (%.0f features), OpenCV ORB "
        "brute force %.3f / %.3f (%.0f)\n",
        scale, share(at1), share(at5), share(features), share(orb1), share(orb5), share(orb_features));
  }
}

void matrix(const char* name, const std::vector<cv::Mat>& images, const Vocabulary& vocabulary) {
  const Images all = describeAll(images, vocabulary);
  std::vector<Described> orb;
  for (const cv::Mat& image : images) orb.push_back(describeOpenCv(image, 400));
  std::printf("%s: similarity (good matches of OpenCV's ORB)\n", name);
  for (std::size_t i = 0; i < images.size(); ++i) {
    for (std::size_t j = i + 1; j < images.size(); ++j) {
      std::size_t good = 0;
      for (const MutualMatch& m : mutualMatches(orb[i].descriptor, orb[j].descriptor))
        good += m.distance <= kGoodDistance ? 1U : 0U;
      std::printf("  %zu-%zu %.4f (%zu)", i, j, static_cast<double>(similarity(all.bag[i], all.bag[j])),
                  good);
    }
  }
  std::printf("\n");
}

std::vector<cv::Mat> fourImages(const char* pattern) {
  std::vector<cv::Mat> images;
  for (int i = 0; i < 4; ++i) images.push_back(readGrey(placeDataFolder() + "/" + cv::format(pattern, i)));
  return images;
}

}  // namespace

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  const Kitchen kitchen = readKitchen();
  if (kitchen.grey.empty()) {
    std::fprintf(stderr, "no data: set SWIFTLET_DATA\n");
    return 1;
  }
  const Vocabulary given = argc > 1 ? readVocabulary(argv[1]) : Vocabulary::shipped();
  std::printf("vocabulary of %zu words\n", given.words());
  if (argc <= 1) kitchenFeatures(kitchen);
  kitchenRetrieval(kitchen, given, argc <= 1);
  corridorRetrieval(given);
  matrix("kimera_lcd (revisits 0-1, 2-3)", fourImages("kimera_lcd/left_%d.png"), given);
  matrix("dbow2_demo (same place 1-3, outdoors 0)", fourImages("dbow2_demo/image%d.png"), given);
  return 0;
}
