// What an image costs until its pose stands: CPU time of `track` and `smooth` on recorded logs, one thread,
// beside what OpenCV's corner detection and tracking take alone on the same frames in the same process.
//
//   benchmark_image_to_pose [LOG...]     (without: the logs of SWIFTLET_DATA, each twice)
//
// Image-to-pose is TrackStage::step and SmoothStage::step; what leaves the window afterwards (trim) and the
// window handed back are a figure of their own. Decoding and IMU samples are not in it. OpenCV's part, at
// keyframes: goodFeaturesToTrack on the left image, calcOpticalFlowPyrLK left to the next left and left to
// right, each from the two images. Prints figures beside what is wanted; asserts none.

#include <cstdio>
#include <exception>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>
#include <string>
#include <variant>
#include <vector>

#include "drivers/recorded/open_log.hpp"
#include "estimator/odometry/pairing.hpp"
#include "estimator/odometry/smooth_stage.hpp"
#include "estimator/odometry/track_stage.hpp"
#include "tests/logs/log_data.hpp"
#include "tests/support/cpu_time.hpp"
#include "tests/support/statistics.hpp"

using namespace swiftlet;
using swiftlet::test::mean;
using swiftlet::test::quantile;
using swiftlet::test::timed;

namespace {

constexpr const char* kLogs[] = {"euroc_mh01_20s", "vil_v102", "vil_mh05", "euroc_v101_micro"};
constexpr int kRuns = 2;
// OpenCV's work, as a common front-end sets it.
constexpr int kCvFeatures = 300;
constexpr double kCvQuality = 0.01;
constexpr double kCvDistance = 20;  // px
constexpr int kCvWindow = 21;       // px
constexpr int kCvMaxLevel = 3;

cv::Mat asMat(const ImageView& v) { return {v.height, v.width, CV_8U, const_cast<std::uint8_t*>(v.data)}; }

/// CPU times [ms], one entry a frame.
struct Times {
  std::vector<double> track, smooth, pose, trim;
};

struct Figures {
  Times frames, keyframes;
  std::vector<double> cv;       // at keyframes
  std::vector<double> cv_pose;  // `pose` of the same keyframes
};

double openCv(const cv::Mat& left, const cv::Mat& right, const cv::Mat& next_left) {
  std::vector<cv::Point2f> corners, to;
  std::vector<std::uint8_t> status;
  std::vector<float> error;
  const cv::Size window(kCvWindow, kCvWindow);
  return timed([&] {
    cv::goodFeaturesToTrack(left, corners, kCvFeatures, kCvQuality, kCvDistance);
    if (corners.empty()) return;
    cv::calcOpticalFlowPyrLK(left, next_left, corners, to, status, error, window, kCvMaxLevel);
    cv::calcOpticalFlowPyrLK(left, right, corners, to, status, error, window, kCvMaxLevel);
  });
}

class Run {
 public:
  Run(const LogSource& source, Figures& figures)
      : track_(source.rig(), source.imuNoise(), settings_),
        smooth_(source.rig(), source.imuNoise(), settings_),
        pairing_(PairingSettings{}),
        tracked_(std::make_unique<TrackedFrame>()),
        output_(std::make_unique<OdometryOutput>()),
        window_(std::make_unique<SmoothedWindow>()),
        figures_(figures) {}

  void addImu(const ImuSample& sample) {
    if (pairing_.holdsImage() && sample.stamp > pairing_.waitingStamp()) {
      held_.push_back(sample);
      return;
    }
    track_.addImu(sample);
    smooth_.addImu(sample);
  }

  void addImage(const CameraFrame& image) {
    StereoFrame frame;
    if (pairing_.push(image, frame).ok()) addFrame(frame);
    if (pairing_.holdsImage()) return;
    const std::vector<ImuSample> held = std::move(held_);
    held_.clear();
    for (const ImuSample& sample : held) addImu(sample);
  }

 private:
  void addFrame(const StereoFrame& frame) {
    if (!keyframe_left_.empty() && frame.has(0)) {
      figures_.cv.push_back(openCv(keyframe_left_, keyframe_right_, asMat(frame.image[0])));
      figures_.cv_pose.push_back(keyframe_pose_);
    }
    keyframe_left_.release();
    bool ok = false;
    const double track = timed([&] { ok = track_.step(frame, Effort{}, *tracked_).ok(); });
    if (!ok) return;
    const double smooth = timed([&] { static_cast<void>(smooth_.step(*tracked_, Effort{}, *output_)); });
    const double trim = timed([&] {
      smooth_.trim();
      smooth_.window(*window_);
    });
    track_.take(*window_);
    Times& times = tracked_->keyframe ? figures_.keyframes : figures_.frames;
    times.track.push_back(track);
    times.smooth.push_back(smooth);
    times.pose.push_back(track + smooth);
    times.trim.push_back(trim);
    if (!tracked_->keyframe || !frame.has(0) || !frame.has(1)) return;
    // Our images of this frame may be gone when the next one is there.
    keyframe_left_ = asMat(frame.image[0]).clone();
    keyframe_right_ = asMat(frame.image[1]).clone();
    keyframe_pose_ = track + smooth;
  }

  OdometrySettings settings_;
  TrackStage track_;
  SmoothStage smooth_;
  Pairing pairing_;
  std::unique_ptr<TrackedFrame> tracked_;
  std::unique_ptr<OdometryOutput> output_;
  std::unique_ptr<SmoothedWindow> window_;
  std::vector<ImuSample> held_;
  cv::Mat keyframe_left_, keyframe_right_;
  double keyframe_pose_ = 0;
  Figures& figures_;
};

void play(const std::string& path, Figures& figures) {
  const std::unique_ptr<LogSource> source = openLog(path);
  const auto run = std::make_unique<Run>(*source, figures);
  SensorMessage message;
  while (source->next(message)) {
    if (const auto* sample = std::get_if<ImuSample>(&message)) {
      run->addImu(*sample);
    } else {
      run->addImage(std::get<CameraFrame>(message));
    }
  }
}

void append(std::vector<double>& to, const std::vector<double>& from) {
  to.insert(to.end(), from.begin(), from.end());
}

Times together(const Times& a, const Times& b) {
  Times all = a;
  append(all.track, b.track);
  append(all.smooth, b.smooth);
  append(all.pose, b.pose);
  append(all.trim, b.trim);
  return all;
}

void printRow(const char* what, const std::vector<double>& t) {
  std::printf("  %-28s %6zu %8.2f %8.2f %8.2f %8.2f %8.2f\n", what, t.size(), mean(t), quantile(t, 0.5),
              quantile(t, 0.99), quantile(t, 1.0), quantile(t, 0.99) / quantile(t, 0.5));
}

void printTimes(const char* what, const Times& times) {
  std::printf("%s\n", what);
  printRow("image to pose", times.pose);
  printRow("  track", times.track);
  printRow("  smooth", times.smooth);
  printRow("trim and window, afterwards", times.trim);
}

void print(const Figures& figures) {
  const Times all = together(figures.frames, figures.keyframes);
  std::printf("CPU of one thread [ms]          count     mean     50 %%     99 %%      max   99/50 %%\n");
  printTimes("all frames", all);
  printTimes("keyframes", figures.keyframes);
  printTimes("other frames", figures.frames);
  std::printf("OpenCV at keyframes\n");
  printRow("corners and tracking twice", figures.cv);
  std::vector<double> ratio;
  for (std::size_t k = 0; k < figures.cv.size(); ++k) ratio.push_back(figures.cv_pose[k] / figures.cv[k]);
  printRow("image to pose over it", ratio);

  const auto line = [](const char* what, double value, double wanted) {
    std::printf("  %-52s %6.2f   at most %.2f   %s\n", what, value, wanted, value <= wanted ? "yes" : "NO");
  };
  std::printf("measured and wanted\n");
  line("all frames, 50 % [ms]", quantile(all.pose, 0.5), 6);
  line("all frames, 99 % [ms]", quantile(all.pose, 0.99), 15);
  line("keyframes, 99 % over 50 %",
       quantile(figures.keyframes.pose, 0.99) / quantile(figures.keyframes.pose, 0.5), 2.5);
  line("other frames, 99 % over 50 %",
       quantile(figures.frames.pose, 0.99) / quantile(figures.frames.pose, 0.5), 2.5);
  line("keyframes over OpenCV, ratio of the medians",
       quantile(figures.cv_pose, 0.5) / quantile(figures.cv, 0.5), 0.5);
  line("keyframes over OpenCV, ratio of the means", mean(figures.cv_pose) / mean(figures.cv), 0.5);
}

}  // namespace

int main(int argc, char** argv) {
  cv::setNumThreads(1);
  std::vector<std::string> logs(argv + 1, argv + argc);
  if (logs.empty()) {
    for (const char* name : kLogs) {
      if (const auto path = findLog(name)) logs.push_back(*path);
    }
  }
  Figures figures;
  try {
    for (int run = 0; run < kRuns; ++run) {
      for (const std::string& log : logs) play(log, figures);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "error: %s\n", error.what());
    return 2;
  }
  if (figures.frames.pose.empty() || figures.cv.empty()) {
    std::printf("no stereo log to measure on\n");
    return 0;
  }
  std::printf("%zu logs, each %d times\n", logs.size(), kRuns);
  print(figures);
  return 0;
}
