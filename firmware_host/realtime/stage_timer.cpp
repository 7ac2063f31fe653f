#include "firmware_host/realtime/stage_timer.hpp"

#include <ctime>

namespace swiftlet {
namespace {

double seconds(clockid_t clock) {
  timespec now{};
  clock_gettime(clock, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

}  // namespace

std::string_view stageName(StageId stage) {
  switch (stage) {
    case StageId::kSource:
      return "source";
    case StageId::kPairing:
      return "pairing";
    case StageId::kImu:
      return "imu";
    case StageId::kTrack:
      return "track";
    case StageId::kSmooth:
      return "smooth";
    case StageId::kFix:
      return "fix";
    case StageId::kTrim:
      return "trim";
    case StageId::kMesh:
      return "mesh";
    case StageId::kLoop:
      return "loop";
    case StageId::kDepth:
      return "map_depth";
    case StageId::kVolume:
      return "map_volume";
    case StageId::kSurface:
      return "map_surface";
    case StageId::kDistance:
      return "map_distance";
    case StageId::kCorrection:
      return "map_correction";
    case StageId::kImageToPose:
      return "image_to_pose";
    case StageId::kExposureToPose:
      return "exposure_to_pose";
    case StageId::kMap:
      return "full_smoothing";
    case StageId::kCount:
      break;
  }
  return "unknown";
}

double wallSeconds() { return seconds(CLOCK_MONOTONIC); }
double threadCpuSeconds() { return seconds(CLOCK_THREAD_CPUTIME_ID); }
double processCpuSeconds() { return seconds(CLOCK_PROCESS_CPUTIME_ID); }

void addTime(StageTable& table, StageId stage, const Spent& spent, bool keyframe) {
  StageTimes& times = table[static_cast<std::size_t>(stage)];
  (keyframe ? times.wall_keyframes : times.wall_frames).add(spent.wall);
  (keyframe ? times.cpu_keyframes : times.cpu_frames).add(spent.cpu);
}

}  // namespace swiftlet
