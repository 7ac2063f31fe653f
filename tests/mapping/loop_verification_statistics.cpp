// Recall, precision, accuracy, honesty and cost of loop verification over all pairs of image sets; run by
// hand.
//
//   loop_verification_statistics [--min-seconds S] [--every N] [FLIGHT...]   (EuRoC folders with truth)

#include <Eigen/LU>
#include <algorithm>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "estimator/geometry/so3.hpp"
#include "mapping/place/feature_depth.hpp"
#include "mapping/place/loop_verification.hpp"
#include "mapping/place/place_extractor.hpp"
#include "tests/mapping/loop_retrieval.hpp"
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

double least_seconds = 10;
const char* draw_into = nullptr;

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
  Verdicts verdicts;
};

// A pair and the matches that were believed, one above the other.
void draw(const ImageSet& set, const Prepared& prepared, std::size_t i, std::size_t j,
          const LoopVerification& result) {
  cv::Mat both;
  cv::vconcat(set.shots[i].grey[0], set.shots[j].grey[0], both);
  cv::cvtColor(both, both, cv::COLOR_GRAY2BGR);
  const int below = set.shots[i].grey[0].rows;
  int color = 0;
  for (const DescriptorMatch& m : result.inliers) {
    const Eigen::Vector2f& a = prepared.keyframes[i].features[m.old_feature].pixel;
    const Eigen::Vector2f& b = prepared.keyframes[j].features[m.new_feature].pixel;
    const cv::Scalar paint = color++ % 2 == 0 ? cv::Scalar(0, 255, 0) : cv::Scalar(0, 160, 255);
    cv::line(both, cv::Point2f(a.x(), a.y()), cv::Point2f(b.x(), b.y() + static_cast<float>(below)), paint);
  }
  cv::imwrite(cv::format("%s/%s_%03zu_%03zu.png", draw_into, set.name.c_str(), i, j), both);
}

// Believed matches that the truth bears out, of those where it can tell.
std::pair<std::size_t, std::size_t> countTrue(const ImageSet& set, const Prepared& prepared, std::size_t i,
                                              std::size_t j, const LoopVerification& result) {
  constexpr double kPixels = 5;
  const CameraModel& camera = set.rig.camera[0];
  const SE3 T_body_cam = set.rig.T_body_cam[0];
  const SE3 T_j_i =
      (set.shots[j].T_world_body * T_body_cam).inverse() * set.shots[i].T_world_body * T_body_cam;
  std::pair<std::size_t, std::size_t> count{0, 0};
  for (const DescriptorMatch& m : result.inliers) {
    const PlaceFeature& a = prepared.keyframes[i].features[m.old_feature];
    const double inverse = trueInverseDistance(set, i, a.pixel.cast<double>());
    if (!(inverse > 0)) continue;
    ++count.second;
    Eigen::Vector2d pixel;
    if (!camera.project(T_j_i * (a.bearing.cast<double>() / inverse), pixel)) continue;
    const Eigen::Vector2f& b = prepared.keyframes[j].features[m.new_feature].pixel;
    if ((pixel - b.cast<double>()).norm() < kPixels) ++count.first;
  }
  return count;
}

struct Wrong {
  double metres = 0, degrees = 0, nees = 0;
};

void tellFalse(const ImageSet& set, const Prepared& prepared, std::size_t i, std::size_t j,
               const LoopVerification& result, const Wrong& wrong) {
  const SE3 truth = set.shots[i].T_world_body.inverse() * set.shots[j].T_world_body;
  const Matrix6d& c = result.covariance;
  const auto [borne_out, told] = countTrue(set, prepared, i, j, result);
  std::printf(
      "    false: %zu %zu, inliers %zu (%zu of %zu true), kept %zu of %zu, %.2f m %.1f deg off (NEES %.0f, "
      "sigmas %.3f rad "
      "%.3f "
      "m), truly %.2f m %.1f deg apart, spread %.3f rad, chi2/dof %.2f\n",
      i, j, result.inliers.size(), borne_out, told, result.kept, result.matches, wrong.metres, wrong.degrees,
      wrong.nees, std::sqrt(c.diagonal().head<3>().maxCoeff()), std::sqrt(c.diagonal().tail<3>().maxCoeff()),
      truth.translation.norm(), logSo3(truth.rotation).norm() * 180 / std::numbers::pi, result.spread,
      result.chi_squared_per_dof);
  if (draw_into != nullptr) draw(set, prepared, i, j, result);
}

// What became of one candidate.
void count(const ImageSet& set, const Prepared& prepared, std::size_t i, std::size_t j,
           const LoopVerification& result, bool verbose, Outcome& out) {
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
  const double nees = error.dot(result.covariance.ldlt().solve(error));
  const bool wrong = metres > kFalseMetres || degrees > kFalseDegrees;
  out.verdicts[i][j] = wrong ? Verdict::kFalse : Verdict::kRight;
  if (wrong) {
    ++out.false_accepted;
    if (verbose) tellFalse(set, prepared, i, j, result, {metres, degrees, nees});
    return;
  }
  ++(revisit ? out.found : out.others_accepted);
  out.metres.push_back(metres);
  out.degrees.push_back(degrees);
  out.nees.push_back(nees);
}

void verifyPairs(const ImageSet& set, const Prepared& prepared, const LoopVerificationSettings& settings,
                 bool verbose, Outcome& out) {
  const auto verifier = std::make_unique<LoopVerifier>(set.rig, settings);
  LoopVerification result;
  out.verdicts.assign(set.shots.size(), std::vector<Verdict>(set.shots.size(), Verdict::kRefused));
  for (std::size_t i = 0; i < set.shots.size(); ++i) {
    for (std::size_t j = i + 1; j < set.shots.size(); ++j) {
      const double apart = set.shots[j].seconds - set.shots[i].seconds;
      if (set.kind[i][j] == PairKind::kUnclear && apart < kNeighbourSeconds) continue;
      const double start = cpuMilliseconds();
      (void)verifier->verify(prepared.keyframes[i], prepared.keyframes[j], {}, 1.0, result);
      out.ms.push_back(cpuMilliseconds() - start);
      count(set, prepared, i, j, result, verbose, out);
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

// What the database proposes, and what comes of it; `reference`: of all pairs.
void propose(const ImageSet& set, const std::vector<PlaceKeyframe>& keyframes, const Verdicts& reference,
             const Verdicts& verdicts) {
  PlaceDatabaseSettings settings;
  settings.exclude = set.exclude_seconds;
  const auto run = [&](const char* name, std::initializer_list<Order> orders) {
    const auto found = retrieve(set, keyframes, Vocabulary::shipped(), settings);
    for (const Order order : orders) reportRetrieval(set, found, settings, reference, verdicts, order, name);
  };
  run("as set", {Order::kScore, Order::kConsistentFirst, Order::kConsistentOnly, Order::kEachIslandFirst});
  settings.per_island = 3;
  run("three of an island", {Order::kScore});
  settings.candidates = settings.per_island = kMaxPlaceCandidates;
  run("32", {Order::kScore});
  settings.min_relative = 0;
  run("32, however unlike", {Order::kScore});
}

bool own_only = false;

void report(const ImageSet& set, bool verbose, const LoopVerificationSettings& settings) {
  std::printf("%s: %zu images\n", set.name.c_str(), set.shots.size());
  Verdicts by_orb;
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
    if (features == Features::kOrb) by_orb = o.verdicts;
    if (features == Features::kOwn)
      propose(set, p.keyframes, by_orb.empty() ? o.verdicts : by_orb, o.verdicts);
  }
}

}  // namespace

int main(int argc, char** argv) {
  LoopVerificationSettings settings;
  bool verbose = false;
  int every = 1;
  bool flights_only = false;
  std::vector<std::string> flights;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--min-seconds") == 0 && i + 1 < argc) {
      least_seconds = std::atof(argv[++i]);
    } else if (std::strcmp(argv[i], "--verbose") == 0) {
      verbose = true;
    } else if (std::strcmp(argv[i], "--draw") == 0 && i + 1 < argc) {
      draw_into = argv[++i];
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
    const auto set = readFlight(flight, least_seconds, every);
    if (set) report(*set, verbose, settings);
  }
  return 0;
}
