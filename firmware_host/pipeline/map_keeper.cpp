#include "firmware_host/pipeline/map_keeper.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "drivers/calibration/input_error.hpp"
#include "estimator/odometry/odometry_inputs.hpp"

namespace swiftlet {
namespace {

enum class Kind : std::uint8_t { kImu, kKeyframe };

std::FILE* openNameless(const std::string& folder) {
  const std::string path = folder + "/keyframes.tmp";
  const int file = open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  if (file < 0) {
    throw InputError(path, 0, "",
                     std::string("the file for keyframes cannot be made: ") + std::strerror(errno),
                     "Give a folder that can be written with --out, or --set smoother.horizon=30");
  }
  unlink(path.c_str());
  return fdopen(file, "w+b");
}

}  // namespace

MapKeeper::MapKeeper(const std::string& folder, const Rig& rig, const ImuNoise& noise,
                     const OdometrySettings& settings)
    : rig_(rigInUse(rig, settings)),
      noise_(inflatedNoise(noise, settings)),
      pixel_sigma_(settings.pixel_sigma),
      monitor_(noise),
      buffer_(kBufferBytes),
      file_(openNameless(folder)) {
  std::setvbuf(file_.get(), buffer_.data(), _IOFBF, buffer_.size());
}

template <typename T>
void MapKeeper::put(const T& value) {
  if (!failed_ && std::fwrite(&value, sizeof(T), 1, file_.get()) == 1) return;
  if (!failed_)
    faults_.add({StatusCode::kFailed, "keyframes for the map could not be written: the disk is full?"});
  failed_ = true;
}

template <typename T>
bool MapKeeper::get(T& value) {
  // Types with Eigen members are of plain doubles, written by this very process.
  return std::fread(static_cast<void*>(&value), sizeof(T), 1, file_.get()) == 1;
}

void MapKeeper::addImu(const ImuSample& sample) {
  if (!monitor_.check(sample).status.ok()) return;
  put(Kind::kImu);
  put(sample);
}

void MapKeeper::addKeyframe(const TrackedFrame& frame, const NavState& state) {
  put(Kind::kKeyframe);
  put(state);
  put(frame.stamp);
  put(frame.index);
  put(frame.camera_present);
  put(frame.features.size());
  for (const TrackedFeature& feature : frame.features) put(feature);
}

bool MapKeeper::readKeyframe(TrackedFrame& frame, NavState& state) {
  std::size_t features = 0;
  if (!get(state) || !get(frame.stamp) || !get(frame.index) || !get(frame.camera_present) || !get(features) ||
      features > kMaxFeatures) {
    return false;
  }
  frame.keyframe = true;
  frame.features.resize(features);
  for (TrackedFeature& feature : frame.features) {
    if (!get(feature)) return false;
  }
  return true;
}

Status MapKeeper::solve(FullSmootherReport& report, std::vector<MapPose>& poses) {
  FullSmootherSettings settings;
  settings.pixel_sigma = pixel_sigma_;
  FullSmoother smoother(rig_, noise_, settings);
  std::rewind(file_.get());
  ImuSample sample;
  TrackedFrame frame;
  NavState state;
  for (Kind kind{}; get(kind);) {
    if (kind == Kind::kImu) {
      if (!get(sample)) break;
      smoother.addImu(sample);
    } else {
      if (!readKeyframe(frame, state)) break;
      const Status kept = smoother.addKeyframe(frame, state);
      if (!kept.ok()) faults_.add(kept);
    }
  }
  for (const LoopRevisit& revisit : revisits_) {
    const Status kept = smoother.addRevisit(revisit);
    if (!kept.ok()) faults_.add(kept);
  }
  const Status status = smoother.solve(report);
  if (!status.ok()) return status;
  for (std::size_t k = 0; k < smoother.size(); ++k) {
    const NavState solved = smoother.state(k);
    poses.push_back({solved.stamp, solved.T_world_body});
  }
  return okStatus();
}

}  // namespace swiftlet
