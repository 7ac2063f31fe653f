// A developer's tool: runs the front-end on a rendered log with exact truth and prints how far its
// tracks are from where their landmarks project, by age. Usage: see printUsage().

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "estimator/frontend/frontend.hpp"
#include "tests/frontend/log_reader.hpp"
#include "tests/frontend/true_depth.hpp"
#include "tests/support/cpu_time.hpp"

using namespace swiftlet;
using namespace swiftlet::testing;

namespace {

struct Options {
  std::string log;
  std::size_t frames = 400;
  std::size_t first = 0;
  int features = 200;
  bool gyro = true;
  bool predict = false;
  bool mono = false;
  FrontendSettings settings;
};

void printUsage() {
  std::puts(
      "track_quality LOG [--frames N] [--first N] [--features N] [--no-gyro] [--predict] [--mono]\n"
      "  [--no-anchor] [--no-find] [--back PX] [--levels N]\n"
      "LOG: an EuRoC folder with truth and depth0 (vil_*). --predict hands in landmarks projected\n"
      "with the true pose, 1 px off, as the smoother would.");
}

Options parse(int argc, char** argv) {
  Options o;
  o.log = argv[1];
  for (int i = 2; i < argc; ++i) {
    const std::string a = argv[i];
    const auto next = [&] { return std::atof(i + 1 < argc ? argv[++i] : "0"); };
    if (a == "--frames") o.frames = static_cast<std::size_t>(next());
    if (a == "--first") o.first = static_cast<std::size_t>(next());
    if (a == "--features") o.features = static_cast<int>(next());
    if (a == "--no-gyro") o.gyro = false;
    if (a == "--predict") o.predict = true;
    if (a == "--mono") o.mono = true;
    if (a == "--no-anchor") o.settings.anchor_refinement = false;
    if (a == "--no-find") o.settings.find_again = false;
    if (a == "--back") o.settings.back_check = static_cast<float>(next());
    if (a == "--levels") o.settings.pyramid_levels = static_cast<int>(next());
  }
  return o;
}

struct Landmark {
  std::size_t frame = 0;  // where its depth is known
  Eigen::Vector3d p_world;
};

struct Bin {
  std::vector<double> error;
};

void printBin(const char* name, Bin& bin) {
  if (bin.error.empty()) return;
  std::sort(bin.error.begin(), bin.error.end());
  const auto n = bin.error.size();
  const auto quantile = [&](double q) {
    return bin.error[static_cast<std::size_t>(q * static_cast<double>(n - 1))];
  };
  double sum = 0;
  std::size_t kept = 0;
  std::size_t outliers = 0;
  for (const double e : bin.error) {
    if (e > 3) {
      ++outliers;
    } else {
      sum += e * e;
      ++kept;
    }
  }
  std::printf("%-16s n %7zu  median %.3f  rms<3 %.3f  90%% %.3f  99%% %.3f  >3px %.2f%%\n", name, n,
              quantile(0.5), std::sqrt(sum / static_cast<double>(std::max<std::size_t>(kept, 1))),
              quantile(0.9), quantile(0.99), 100.0 * static_cast<double>(outliers) / static_cast<double>(n));
}

constexpr std::array<std::size_t, 9> kAges{0, 1, 2, 5, 10, 20, 40, 80, 1000};

struct Report {
  std::array<std::array<Bin, kAges.size()>, 2> by_age;
  Bin first_stereo;
  std::array<Bin, 2> all;
  std::map<TrackId, std::size_t> length;
  FrontendStatistics sum;
  double milliseconds = 0;
  double worst = 0;
  std::size_t frames = 0, keyframes = 0, features = 0, stereo = 0;
  double keyframe_ms = 0;
};

void addStatistics(FrontendStatistics& sum, const FrontendStatistics& s) {
  sum.tracked += s.tracked;
  sum.lost += s.lost;
  sum.refined += s.refined;
  sum.false_motion += s.false_motion;
  sum.false_stereo += s.false_stereo;
  sum.found_again += s.found_again;
  sum.detected += s.detected;
  sum.matched += s.matched;
  sum.match_failed += s.match_failed;
}

void print(const Options& options, Report& r) {
  const auto n = static_cast<double>(r.frames);
  double length = 0;
  std::size_t long_tracks = 0;
  for (const auto& [id, frames] : r.length) {
    length += static_cast<double>(frames);
    long_tracks += frames >= 20 ? 1 : 0;
  }
  std::printf(
      "%s: %zu frames, %zu keyframes, %.1f features (%.1f stereo), %zu tracks, mean length %.1f, >=20: %zu\n",
      options.log.c_str(), r.frames, r.keyframes, static_cast<double>(r.features) / n,
      static_cast<double>(r.stereo) / n, r.length.size(),
      length / static_cast<double>(std::max<std::size_t>(r.length.size(), 1)), long_tracks);
  std::printf("time: %.3f ms mean, %.3f on keyframes, worst %.3f\n", r.milliseconds / n,
              r.keyframe_ms / static_cast<double>(std::max<std::size_t>(r.keyframes, 1)), r.worst);
  const FrontendStatistics& s = r.sum;
  std::printf(
      "per frame: tracked %.1f lost %.2f refined %.1f false_motion %.2f false_stereo %.2f found %.2f "
      "detected %.2f "
      "matched %.2f failed %.2f\n",
      s.tracked / n, s.lost / n, s.refined / n, s.false_motion / n, s.false_stereo / n, s.found_again / n,
      s.detected / n, s.matched / n, s.match_failed / n);
  for (std::size_t c = 0; c < 2; ++c) {
    for (std::size_t k = 0; k + 1 < kAges.size(); ++k) {
      char name[40];
      std::snprintf(name, sizeof name, "cam%zu age %zu-%zu", c, kAges[k], kAges[k + 1] - 1);
      printBin(name, r.by_age[c][k]);
    }
    printBin(c == 0 ? "cam0 all" : "cam1 all", r.all[c]);
  }
  printBin("new stereo", r.first_stereo);
}

void fillPrediction(const EurocLog& log, const SE3& T_world_body,
                    const std::map<TrackId, Landmark>& landmarks,
                    const std::map<TrackId, std::size_t>& last_seen, std::size_t frame,
                    FrontendPrediction& prediction) {
  // Landmarks seen in the last 100 frames, as a window of 5 s would know them.
  for (auto it = landmarks.rbegin(); it != landmarks.rend(); ++it) {
    const auto seen = last_seen.find(it->first);
    if (seen == last_seen.end() || frame - seen->second > 100) continue;
    PredictedLandmark p;
    p.id = it->first;
    p.gate = 5;
    for (std::size_t c = 0; c < 2; ++c) {
      Eigen::Vector2d pixel;
      const Eigen::Vector3d p_cam = (T_world_body * log.rig.T_body_cam[c]).inverse() * it->second.p_world;
      p.visible[c] = log.rig.camera[c].project(p_cam, pixel) && log.rig.camera[c].inImage(pixel, 4);
      p.pixel[c] = (pixel + Eigen::Vector2d(0.7, -0.7)).cast<float>();
    }
    if (!p.visible[0] && !p.visible[1]) continue;
    if (!prediction.landmarks.tryPushBack(p)) return;
  }
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 2 || std::strcmp(argv[1], "--help") == 0) {
    printUsage();
    return 2;
  }
  const Options options = parse(argc, argv);
  EurocLog log = EurocLog::open(options.log);
  if (log.stamps.empty()) {
    std::printf("%s: no such log\n", options.log.c_str());
    return 2;
  }
  if (options.mono) log.rig.camera_count = 1;
  Frontend frontend(log.rig, options.settings);
  const Eigen::Vector3d bias =
      log.truth.empty() ? Eigen::Vector3d::Zero() : log.truth[log.truth.size() / 2].bias_gyro;
  std::map<TrackId, Landmark> landmarks;
  std::map<TrackId, std::size_t> last_seen;
  std::map<TrackId, bool> had_right;
  Report report;
  auto prediction = std::make_unique<FrontendPrediction>();
  auto tracked = std::make_unique<TrackedFrame>();
  const std::size_t end = std::min(log.stamps.size(), options.first + options.frames);
  for (std::size_t k = options.first; k < end; ++k) {
    const std::int64_t stamp = log.stamps[k];
    std::array<GreyImage, 2> image{log.image(0, stamp), log.image(1, stamp)};
    StereoFrame frame;
    frame.stamp = {stamp};
    frame.index = k;
    for (std::size_t c = 0; c < log.rig.camera_count; ++c) frame.image[c] = image[c].view();
    SE3 T_world_body;
    const bool has_truth = log.pose(stamp, T_world_body);
    prediction->has_rotation = options.gyro && k > options.first;
    prediction->landmarks.clear();
    if (prediction->has_rotation)
      prediction->R_body_prev_body_cur = log.rotation(log.stamps[k - 1], stamp, bias);
    if (options.predict && has_truth) fillPrediction(log, T_world_body, landmarks, last_seen, k, *prediction);
    const double start = test::cpuMilliseconds();
    const Status status = frontend.step(frame, *prediction, options.features, *tracked);
    const double ms = test::cpuMilliseconds() - start;
    if (!status.ok()) std::printf("frame %zu: %s\n", k, status.what);
    ++report.frames;
    report.milliseconds += ms;
    report.worst = std::max(report.worst, ms);
    report.keyframes += tracked->keyframe ? 1 : 0;
    if (tracked->keyframe) report.keyframe_ms += ms;
    report.features += tracked->features.size();
    addStatistics(report.sum, frontend.statistics());
    const DepthImage depth = log.depth(stamp);
    for (const TrackedFeature& f : tracked->features) {
      ++report.length[f.id];
      last_seen[f.id] = k;
      report.stereo += f.seen[0] && f.seen[1] ? 1 : 0;
      auto known = landmarks.find(f.id);
      const bool new_stereo = f.seen[0] && f.seen[1] && !had_right[f.id];
      had_right[f.id] = f.seen[1];
      if (known == landmarks.end() && depth.width > 0 && f.seen[0] && has_truth) {
        Eigen::Vector3d bearing;
        double z = 0;
        if (!log.rig.camera[0].unproject(f.pixel[0].cast<double>(), bearing) || !depthAt(depth, bearing, z))
          continue;
        Landmark landmark;
        landmark.frame = k;
        landmark.p_world = T_world_body * (log.rig.T_body_cam[0] * (bearing * (z / bearing.z())));
        known = landmarks.emplace(f.id, landmark).first;
      }
      if (known == landmarks.end() || !has_truth) continue;
      const std::size_t age = k - known->second.frame;
      for (std::size_t c = 0; c < 2; ++c) {
        if (!f.seen[c]) continue;
        Eigen::Vector2d pixel;
        const Eigen::Vector3d p_cam =
            (T_world_body * log.rig.T_body_cam[c]).inverse() * known->second.p_world;
        if (!log.rig.camera[c].project(p_cam, pixel)) continue;
        const double error = (pixel - f.pixel[c].cast<double>()).norm();
        for (std::size_t b = 0; b + 1 < kAges.size(); ++b) {
          if (age >= kAges[b] && age < kAges[b + 1]) report.by_age[c][b].error.push_back(error);
        }
        if (age > 0) report.all[c].error.push_back(error);
        if (c == 1 && new_stereo && age == 0) report.first_stereo.error.push_back(error);
      }
    }
  }
  print(options, report);
  return 0;
}
