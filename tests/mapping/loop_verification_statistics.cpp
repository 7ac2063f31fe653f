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

using test::cpuMilliseconds;
using test::quantile;

ImageView viewOf(const cv::Mat& image) {
  return {image.data, image.cols, image.rows, static_cast<int>(image.step)};
}

std::FILE* dump = nullptr;

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
  std::vector<double> metres, degrees, nees, ms, accepted_ms, chi;
};

void verifyPairs(const ImageSet& set, const Prepared& prepared, const LoopVerificationSettings& settings,
                 bool verbose, Outcome& out) {
  const auto verifier = std::make_unique<LoopVerifier>(set.rig, settings);
  LoopVerification result;
  for (std::size_t i = 0; i < set.shots.size(); ++i) {
    for (std::size_t j = i + 1; j < set.shots.size(); ++j) {
      const PairKind kind = set.kind[i][j];
      if (kind == PairKind::kUnclear && set.has_truth && set.shots[j].seconds - set.shots[i].seconds < 5)
        continue;
      const double start = cpuMilliseconds();
      (void)verifier->verify(prepared.keyframes[i], prepared.keyframes[j], {}, 1.0, result);
      out.ms.push_back(cpuMilliseconds() - start);
      if (kind == PairKind::kRevisit)
        ++out.revisits;
      else
        ++out.others;
      if (dump && result.consensus > 0 && set.has_truth) {
        const SE3 truth = set.shots[i].T_world_body.inverse() * set.shots[j].T_world_body;
        const SE3 d = result.T_old_new.inverse() * truth;
        std::fprintf(dump, "%s %zu %zu %d %d %.3f %.2f %zu %zu %zu %zu %zu %.3f %.3f %.2f\n",
                     set.name.c_str(), i, j, static_cast<int>(kind), static_cast<int>(result.fate),
                     d.translation.norm(), logSo3(d.rotation).norm() * 57.3, result.matches,
                     result.matches_with_depth, result.consensus, result.kept, result.inliers.size(), 0.0,
                     result.spread, result.chi_squared_per_dof);
      }
      if (!result.accepted()) {
        ++(kind == PairKind::kRevisit ? out.lost : out.refused)[result.fate];
        continue;
      }
      out.accepted_ms.push_back(out.ms.back());
      out.chi.push_back(result.chi_squared_per_dof);
      if (!set.has_truth) {
        ++(kind == PairKind::kRevisit ? out.found : out.others_accepted);
        continue;
      }
      const SE3 truth = set.shots[i].T_world_body.inverse() * set.shots[j].T_world_body;
      const SE3 d = result.T_old_new.inverse() * truth;
      Vector6d e;
      e << logSo3(d.rotation), d.translation;
      const double metres = e.tail<3>().norm();
      const double degrees = e.head<3>().norm() * 180 / std::numbers::pi;
      if (metres > kFalseMetres || degrees > kFalseDegrees) {
        ++out.false_accepted;
        if (verbose)
          std::printf(
              "    false: %zu %zu kind %d inliers %zu of %zu, %.2f m %.1f deg off, spread %.3f chi2 %.2f, "
              "consensus %zu\n",
              i, j, static_cast<int>(kind), result.inliers.size(), result.matches, metres, degrees,
              result.spread, result.chi_squared_per_dof, result.consensus);
        continue;
      }
      ++(kind == PairKind::kRevisit ? out.found : out.others_accepted);
      out.metres.push_back(metres);
      out.degrees.push_back(degrees);
      out.nees.push_back(e.dot(result.covariance.ldlt().solve(e)));
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
    Outcome o;
    verifyPairs(set, p, settings, verbose, o);
    std::printf("  %s: revisits found %zu of %zu (%.3f), other pairs accepted rightly %zu, falsely %zu\n",
                features == Features::kOrb ? "ORB" : "own", o.found, o.revisits,
                static_cast<double>(o.found) / std::max<double>(1, static_cast<double>(o.revisits)),
                o.others_accepted, o.false_accepted);
    std::printf(
        "    error median %.4f m %.3f deg, p90 %.4f m %.3f deg; NEES median %.1f mean %.1f; chi2/dof %.2f\n",
        quantile(o.metres, 0.5), quantile(o.degrees, 0.5), quantile(o.metres, 0.9), quantile(o.degrees, 0.9),
        quantile(o.nees, 0.5), test::mean(o.nees), quantile(o.chi, 0.5));
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
    } else if (std::strcmp(argv[i], "--dump") == 0) {
      dump = std::fopen(argv[++i], "w");
    } else if (std::strcmp(argv[i], "--own-only") == 0) {
      own_only = true;
    } else if (std::strcmp(argv[i], "--every") == 0 && i + 1 < argc) {
      every = std::atoi(argv[++i]);
    } else if (std::strcmp(argv[i], "--flights-only") == 0) {
      flights_only = true;
    } else {
      flights.emplace_back(argv[i]);
    }
  }
  const LoopVerificationSettings settings;
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
