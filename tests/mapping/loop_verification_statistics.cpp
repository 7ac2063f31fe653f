// Recall, precision, accuracy, honesty and cost of loop verification over all pairs of image sets; run by
// hand.
//
//   loop_verification_statistics [--min-seconds S] [FLIGHT...]   (folders of `swiftlet simulate --depth-every
//   1`)

#include <Eigen/LU>
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <numbers>

#include "estimator/geometry/so3.hpp"
#include "mapping/place/feature_depth.hpp"
#include "mapping/place/loop_verification.hpp"
#include "mapping/place/place_extractor.hpp"
#include "tests/mapping/loop_sets.hpp"
#include "tests/support/cpu_time.hpp"
#include "tests/support/statistics.hpp"

using namespace swiftlet;             // NOLINT(google-build-using-namespace)
using namespace swiftlet::loop_sets;  // NOLINT(google-build-using-namespace)

namespace {

// An accepted pose farther from the truth than this is false.
constexpr double kFalseMetres = 0.3;
constexpr double kFalseDegrees = 6.0;
// Pairs nearer in time are no loops.
constexpr double kNeighbourSeconds = 5.0;

using test::cpuMilliseconds;
using test::quantile;

ImageView viewOf(const cv::Mat& image) {
  return {image.data, image.cols, image.rows, static_cast<int>(image.step)};
}

enum class Features { kOrb, kOwn };

struct Prepared {
  std::vector<PlaceKeyframe> keyframes;
  std::vector<double> extract_ms, depth_ms, depth_share, depth_error;  // error in sigma
};

Prepared prepare(const ImageSet& set, Features features) {
  Prepared out;
  out.keyframes.resize(set.shots.size());
  const bool stereo = set.rig.camera_count > 1;
  std::unique_ptr<StereoDepth> depth;
  if (stereo) depth = std::make_unique<StereoDepth>(set.rig);
  PlaceExtractorSettings extractor_settings;
  PlaceExtractor extractor(set.rig.camera[0].width(), set.rig.camera[0].height(), extractor_settings);
  for (std::size_t i = 0; i < set.shots.size(); ++i) {
    PlaceKeyframe& keyframe = out.keyframes[i];
    const double start = cpuMilliseconds();
    if (features == Features::kOrb) {
      extractOrb(set, i, 500, keyframe);
    } else {
      (void)extractor.extract(viewOf(set.shots[i].grey[0]), set.rig.camera[0], TrackedFrame{}, keyframe);
    }
    keyframe.index = i;
    const double extracted = cpuMilliseconds();
    out.extract_ms.push_back(extracted - start);
    if (stereo) {
      std::size_t found = 0;
      (void)depth->fill(viewOf(set.shots[i].grey[0]), viewOf(set.shots[i].grey[1]), keyframe, found);
      out.depth_ms.push_back(cpuMilliseconds() - extracted);
      out.depth_share.push_back(static_cast<double>(found) /
                                std::max<double>(1, static_cast<double>(keyframe.features.size())));
      for (const PlaceFeature& f : keyframe.features) {
        const double truth = trueInverseDistance(set, i, f.pixel.cast<double>());
        if (truth > 0 && f.inverse_depth_sigma > 0) {
          out.depth_error.push_back((static_cast<double>(f.inverse_depth) - truth) /
                                    static_cast<double>(f.inverse_depth_sigma));
        }
      }
    } else if (!set.shots[i].depth.empty()) {
      fillFromDepthImage(set, i, keyframe);
    }
  }
  return out;
}

struct Outcome {
  std::size_t revisits = 0, found = 0, others = 0, others_accepted = 0, false_accepted = 0;
  std::map<LoopFate, std::size_t> lost, refused;
  std::vector<double> metres, degrees, nees, ms, accepted_ms, chi_squared;
};

// What became of one candidate.
void count(const ImageSet& set, std::size_t i, std::size_t j, const LoopVerification& result, bool verbose,
           Outcome& out) {
  const bool revisit = set.kind[i][j] == PairKind::kRevisit;
  ++(revisit ? out.revisits : out.others);
  if (!result.accepted()) {
    ++(revisit ? out.lost : out.refused)[result.fate];
    return;
  }
  out.accepted_ms.push_back(out.ms.back());
  out.chi_squared.push_back(result.chi_squared_per_dof);
  const SE3 truth = set.shots[i].T_world_body.inverse() * set.shots[j].T_world_body;
  const SE3 difference = result.T_old_new.inverse() * truth;
  Vector6d error;
  error << logSo3(difference.rotation), difference.translation;
  const double metres = error.tail<3>().norm();
  const double degrees = error.head<3>().norm() * 180 / std::numbers::pi;
  if (metres > kFalseMetres || degrees > kFalseDegrees) {
    ++out.false_accepted;
    if (verbose) {
      std::printf("    false: %zu %zu, inliers %zu, kept %zu of %zu, %.2f m %.1f deg off, spread %.3f rad\n",
                  i, j, result.inliers.size(), result.kept, result.matches, metres, degrees, result.spread);
    }
    return;
  }
  ++(revisit ? out.found : out.others_accepted);
  out.metres.push_back(metres);
  out.degrees.push_back(degrees);
  out.nees.push_back(error.dot(result.covariance.ldlt().solve(error)));
}

void verifyPairs(const ImageSet& set, const Prepared& prepared, const LoopVerificationSettings& settings,
                 bool verbose, Outcome& out) {
  const auto verifier = std::make_unique<LoopVerifier>(set.rig, settings);
  LoopVerification result;
  for (std::size_t i = 0; i < set.shots.size(); ++i) {
    for (std::size_t j = i + 1; j < set.shots.size(); ++j) {
      const double apart = set.shots[j].seconds - set.shots[i].seconds;
      if (set.kind[i][j] == PairKind::kUnclear && apart < kNeighbourSeconds) continue;
      const double start = cpuMilliseconds();
      (void)verifier->verify(prepared.keyframes[i], prepared.keyframes[j], {}, 1.0, result);
      out.ms.push_back(cpuMilliseconds() - start);
      count(set, i, j, result, verbose, out);
    }
  }
}

// Without calibration and depth: how many matches one epipolar geometry explains, pair by pair.
void reportMono(const ImageSet& set, const Prepared& prepared) {
  const auto matcher = std::make_unique<DescriptorMatcher>();
  const auto ransac =
      std::make_unique<MonoRansac>(RansacSettings{.bearing_sigma = 1.0 / set.rig.camera[0].focal()});
  for (std::size_t i = 0; i < set.shots.size(); ++i) {
    for (std::size_t j = i + 1; j < set.shots.size(); ++j) {
      const PlaceFeatures& a = prepared.keyframes[i].features;
      const PlaceFeatures& b = prepared.keyframes[j].features;
      DescriptorMatches matches;
      (void)matcher->match(a, b, {}, matches);
      std::vector<Eigen::Vector3d> from;
      std::vector<Eigen::Vector3d> to;
      for (const DescriptorMatch& m : matches) {
        from.push_back(a[m.old_feature].bearing.cast<double>());
        to.push_back(b[m.new_feature].bearing.cast<double>());
      }
      RansacResult result;
      (void)ransac->fivePoint(from, to, i * 100 + j, result);
      std::printf("    %zu %zu%s: matches %zu, five-point inliers %zu\n", i, j,
                  set.kind[i][j] == PairKind::kRevisit ? " (revisit)" : "", matches.size(),
                  result.inlier_count);
    }
  }
}

void printFates(const char* what, const std::map<LoopFate, std::size_t>& fates) {
  std::printf("    %s:", what);
  for (const auto& [fate, count] : fates) std::printf(" %s %zu;", describe(fate), count);
  std::printf("\n");
}

bool own_only = false;

void report(const ImageSet& set, bool verbose, const LoopVerificationSettings& settings) {
  std::printf("%s: %zu images\n", set.name.c_str(), set.shots.size());
  for (const Features features : {Features::kOrb, Features::kOwn}) {
    if (own_only && features == Features::kOrb) continue;
    const Prepared p = prepare(set, features);
    if (!set.has_truth) {
      std::printf("  %s\n", features == Features::kOrb ? "ORB" : "own");
      reportMono(set, p);
      continue;
    }
    Outcome o;
    verifyPairs(set, p, settings, verbose, o);
    std::printf("  %s: revisits found %zu of %zu (%.3f), other pairs accepted rightly %zu, falsely %zu\n",
                features == Features::kOrb ? "ORB" : "own", o.found, o.revisits,
                static_cast<double>(o.found) / std::max<double>(1, static_cast<double>(o.revisits)),
                o.others_accepted, o.false_accepted);
    std::printf(
        "    error median %.4f m %.3f deg, p90 %.4f m %.3f deg; NEES median %.1f mean %.1f; chi2/dof %.2f\n",
        quantile(o.metres, 0.5), quantile(o.degrees, 0.5), quantile(o.metres, 0.9), quantile(o.degrees, 0.9),
        quantile(o.nees, 0.5), test::mean(o.nees), quantile(o.chi_squared, 0.5));
    std::printf(
        "    CPU ms: verify p50 %.2f p99 %.2f max %.2f (accepted p50 %.2f p99 %.2f); extract p50 %.2f; "
        "stereo depth p50 %.2f p99 %.2f\n",
        quantile(o.ms, 0.5), quantile(o.ms, 0.99), quantile(o.ms, 1), quantile(o.accepted_ms, 0.5),
        quantile(o.accepted_ms, 0.99), quantile(p.extract_ms, 0.5), quantile(p.depth_ms, 0.5),
        quantile(p.depth_ms, 0.99));
    if (!p.depth_share.empty()) {
      std::vector<double> size;
      for (const double e : p.depth_error) size.push_back(std::abs(e));
      const auto far = std::count_if(size.begin(), size.end(), [](double e) { return e > 4; });
      std::printf(
          "    stereo depth: share %.2f; error/sigma: |e| p50 %.2f p68 %.2f p95 %.2f, beyond 4: %.3f\n",
          quantile(p.depth_share, 0.5), quantile(size, 0.5), quantile(size, 0.68), quantile(size, 0.95),
          static_cast<double>(far) / std::max<double>(1, static_cast<double>(size.size())));
    }
    printFates("revisits lost", o.lost);
    printFates("others refused", o.refused);
  }
}

}  // namespace

int main(int argc, char** argv) {
  LoopVerificationSettings settings;
  double min_seconds = 10;
  bool verbose = false;
  int every = 1;
  bool flights_only = false;
  std::vector<std::string> flights;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--min-seconds") == 0 && i + 1 < argc) {
      min_seconds = std::atof(argv[++i]);
    } else if (std::strcmp(argv[i], "--verbose") == 0) {
      verbose = true;
    } else if (std::strcmp(argv[i], "--own-only") == 0) {
      own_only = true;
    } else if (std::strcmp(argv[i], "--every") == 0 && i + 1 < argc) {
      every = std::atoi(argv[++i]);
    } else if (std::strcmp(argv[i], "--no-five-point") == 0) {
      settings.five_point = false;
    } else if (std::strcmp(argv[i], "--flights-only") == 0) {
      flights_only = true;
    } else {
      flights.emplace_back(argv[i]);
    }
  }
  if (!flights_only) {
    for (const auto& read : {readKimera, readKitchen, readDbowDemo}) {
      const auto set = read(dataFolder());
      if (set) report(*set, verbose, settings);
    }
  }
  for (const std::string& flight : flights) {
    const auto set = readFlight(flight, min_seconds, every);
    if (set) report(*set, verbose, settings);
  }
  return 0;
}
