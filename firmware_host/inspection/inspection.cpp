#include "firmware_host/inspection/inspection.hpp"

#include "firmware_host/inspection/image_findings.hpp"
#include "firmware_host/inspection/motion_findings.hpp"
#include "firmware_host/inspection/motion_fit.hpp"

namespace swiftlet {
namespace {

constexpr double kAlways = 2;             // s of images at the beginning
constexpr double kAfterMotion = 1;        // s of images used after motion has ended
constexpr std::size_t kStereoEvery = 10;  // images
constexpr Duration kSameTime = Duration::fromMilliseconds(5);

}  // namespace

Inspection::Inspection(const Calibration& calibration, std::size_t most_images)
    : calibration_(calibration), most_images_(most_images), order_(calibration.rig) {}

void Inspection::add(const ImuSample& sample) {
  samples_.push_back(sample);
  gyro_sum_ += sample.gyro;
}

bool Inspection::moves() const {
  constexpr double kSpan = 0.25;   // s
  constexpr double kMoves = 0.05;  // rad/s from the mean so far, which contains the gyro's offset
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double count = 0;
  for (auto it = samples_.rbegin(); it != samples_.rend(); ++it, ++count) {
    if ((samples_.back().stamp - it->stamp).seconds() > kSpan) break;
    sum += it->gyro;
  }
  if (count == 0) return false;
  return (sum / count - gyro_sum_ / static_cast<double>(samples_.size())).norm() > kMoves;
}

bool Inspection::wants(Stamp stamp, std::uint32_t camera) {
  if (camera != 0) {
    const std::size_t count = tracks_.images().size();
    return order_.wantsMore() && count > 0 && count % kStereoEvery == 0 &&
           stamp - tracks_.images().back().stamp < kSameTime &&
           tracks_.images().back().stamp - stamp < kSameTime;
  }
  stamps_.push_back(stamp);
  if (tracks_.images().size() >= most_images_) return false;
  if (moves()) moved_ = stamp;
  return (stamp - stamps_.front()).seconds() < kAlways ||
         (moved_ && (stamp - *moved_).seconds() < kAfterMotion);
}

void Inspection::add(const CameraFrame& frame) {
  if (frame.image.empty()) return;
  if (frame.camera != 0) {
    order_.add(tracks_.newest(), tracks_.images().back(), frame.image);
    return;
  }
  const bool follows = !taken_.empty() && taken_.back() + 2 == stamps_.size();
  taken_.push_back(stamps_.size() - 1);
  tracks_.add(frame.stamp, frame.image, follows);
}

bool Inspection::done() const {
  constexpr double kBeyond = 1;  // s
  return tracks_.images().size() >= most_images_ && !samples_.empty() &&
         (samples_.back().stamp - tracks_.images().back().stamp).seconds() > kMaxShift + kBeyond;
}

InspectionReport Inspection::report() const {
  InspectionReport report;
  const std::vector<TrackedImage>& images = tracks_.images();
  report.images = images.size();
  report.findings = imageFindings(stamps_, images);
  if (const auto swapped = order_.finding()) report.findings.push_back(*swapped);
  const std::vector<Stamp> all_even = evenStamps(stamps_);
  std::vector<Stamp> even;
  for (const std::size_t i : taken_) even.push_back(all_even[i]);
  const std::vector<Finding> motion = motionFindings(calibration_, samples_, images, even, report.measured);
  report.findings.insert(report.findings.end(), motion.begin(), motion.end());
  return report;
}

}  // namespace swiftlet
