#include "tests/fuzz/fuzz_targets.hpp"

#include <array>
#include <cmath>
#include <cstdlib>
#include <sstream>
#include <string>
#include <vector>

#include "drivers/calibration/calibration.hpp"
#include "drivers/device/byte_fields.hpp"
#include "drivers/recorded/image_list.hpp"
#include "drivers/recorded/imu_file.hpp"
#include "drivers/recorded/recording_checksum.hpp"
#include "drivers/recorded/track_file.hpp"
#include "drivers/recorded/trajectory_file.hpp"
#include "firmware_host/inputs/vocabulary/vocabulary_file.hpp"
#include "firmware_host/lab/import/gpmf.hpp"
#include "firmware_host/lab/import/motion_of_video.hpp"
#include "firmware_host/lab/modules/g2o_file.hpp"
#include "firmware_host/outputs/map_files/kept_graph_file.hpp"
#include "firmware_host/outputs/map_files/kept_map.hpp"
#include "firmware_host/outputs/map_files/ply_file.hpp"
#include "mapping/pose_graph/pose_graph_optimizer.hpp"
#include "tests/fuzz/demand.hpp"
#include "tests/fuzz/fuzz_autopilot.hpp"
#include "tests/fuzz/fuzz_bag.hpp"
#include "tests/fuzz/fuzz_can.hpp"
#include "tests/fuzz/fuzz_clocks.hpp"
#include "tests/fuzz/fuzz_decoders.hpp"
#include "tests/fuzz/fuzz_faults.hpp"
#include "tests/fuzz/fuzz_image.hpp"
#include "tests/fuzz/fuzz_keyframes.hpp"
#include "tests/fuzz/fuzz_recording.hpp"

namespace swiftlet::fuzz {
namespace {

template <typename Rows>
void demandRisingStamps(const Rows& rows) {
  for (std::size_t i = 1; i < rows.size(); ++i) demand(rows[i - 1].stamp < rows[i].stamp);
}

void imuCsv(std::string_view text) {
  LogCounters counters;
  LogWarnings warnings;
  try {
    const std::vector<ImuSample> samples = readImuText("imu.csv", text, counters, warnings);
    demand(!samples.empty());
    demandRisingStamps(samples);
    for (const ImuSample& s : samples) demand(s.gyro.allFinite() && s.accel.allFinite());
  } catch (const InputError&) {
  }
}

void imageCsv(std::string_view text) {
  LogCounters counters;
  LogWarnings warnings;
  try {
    demandRisingStamps(readImageListText("data.csv", text, counters, warnings));
  } catch (const InputError&) {
  }
}

void trajectory(std::string_view text) {
  LogCounters counters;
  LogWarnings warnings;
  try {
    const Trajectory poses = readTrajectoryText("poses", text, counters, warnings);
    demandRisingStamps(poses);
    for (const TrajectoryPoint& p : poses) {
      demand(p.T_world_body.translation.allFinite());
      demand(std::abs(p.T_world_body.rotation.norm() - 1) < 1e-9);
      (void)formatTum(p.stamp, p.T_world_body);
    }
  } catch (const InputError&) {
  }
}

void tracks(std::string_view text) {
  try {
    TrackReader reader("tracks.csv", text);
    TrackedFrame frame;
    Stamp newest;
    for (bool first = true; reader.next(frame); first = false) {
      demand(first || newest < frame.stamp);
      newest = frame.stamp;
      for (const TrackedFeature& f : frame.features) {
        demand(f.seen[0] || f.seen[1]);
        demand(f.pixel[0].allFinite() && f.pixel[1].allFinite());
      }
    }
  } catch (const InputError&) {
  }
}

void demandSane(const Calibration& calibration) {
  for (std::size_t i = 0; i < calibration.rig.camera_count; ++i) {
    demand(calibration.rig.T_body_cam[i].translation.allFinite());
    demand(calibration.rig.T_body_cam[i].rotation.coeffs().allFinite());
    demand(calibration.rig.camera[i].width() > 0 && calibration.rig.camera[i].focal() > 0);
  }
  demand(calibration.noise.gyro_density > 0 && calibration.noise.accel_walk > 0);
  (void)describe(calibration);
}

constexpr const char* kGoodImu =
    "update_rate: 200.0\nrate_hz: 200\naccelerometer_noise_density: 2.0e-03\naccelerometer_random_walk: "
    "3.0e-03\n"
    "gyroscope_noise_density: 1.6968e-04\ngyroscope_random_walk: 1.9393e-05\n";

/// The text up to the first NUL or "...\n" is the camera, the rest the IMU; without a rest a good one.
std::array<std::string_view, 2> twoFiles(std::string_view text) {
  const std::size_t at = text.find("...\n");
  if (at == std::string_view::npos) return {text, kGoodImu};
  return {text.substr(0, at), text.substr(at + 4)};
}

void eurocYaml(std::string_view text) {
  const auto [camera, imu] = twoFiles(text);
  try {
    demandSane(parseEurocCalibration({{"cam0", camera}}, {"imu0", imu}));
  } catch (const InputError&) {
  }
}

void kalibrYaml(std::string_view text) {
  const auto [chain, imu] = twoFiles(text);
  try {
    demandSane(parseKalibrCalibration({"chain", chain}, {"imu", imu}));
  } catch (const InputError&) {
  }
}

/// ROS camera_info, OpenCV and Basalt: whatever the text is, each reader is given it.
void cameraFiles(std::string_view text) {
  const auto [camera, imu_text] = twoFiles(text);
  const std::string imu =
      std::string(imu_text) + "T_imu_cam0: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]\n";
  for (const int form : {0, 1, 2}) {
    try {
      demandSane(form == 0   ? parseCameraInfoCalibration({{"cam0", camera}}, {"imu0", imu})
                 : form == 1 ? parseOpenCvCalibration({{"cam0", camera}}, {"imu0", imu})
                             : parseBasaltCalibration({"calibration", camera}));
    } catch (const InputError&) {
    }
  }
}

void gpmf(std::string_view text) {
  const auto payload = readGpmf({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  if (!payload) return;
  for (const GpmfChannel* channel : {&payload->accel, &payload->gyro}) {
    for (const Eigen::Vector3d& value : channel->values) demand(value.allFinite());
  }
}

void phoneLog(std::string_view text) {
  try {
    const PhoneLog log = readPhoneLog("data.jsonl", text);
    demand(!log.samples.empty());
    for (const ImuSample& sample : log.samples) demand(sample.gyro.allFinite() && sample.accel.allFinite());
  } catch (const InputError&) {
  }
}

void ply(std::string_view text) {
  try {
    const TriangleMesh mesh = readPlyText("mesh.ply", text);
    demand(mesh.grey.empty() || mesh.grey.size() == mesh.vertices.size());
    demand(mesh.labels.size() == mesh.faces.size());
    for (const Eigen::Vector3f& p : mesh.vertices) demand(p.allFinite());
    for (const auto& face : mesh.faces) {
      for (const std::uint32_t v : face) demand(v < mesh.vertices.size());
    }
  } catch (const InputError&) {
  }
}

/// With the checksum that its content asks for: what lies behind that check is to be reached.
std::string withChecksum(std::string_view text) {
  std::string bytes(text);
  constexpr std::size_t kChecksum = 8;
  if (!text.starts_with("SWPLACES") || bytes.size() < 2 * kChecksum) return bytes;
  std::uint64_t hash = 14695981039346656037ULL;
  for (std::size_t i = 0; i + kChecksum < bytes.size(); ++i) {
    hash = (hash ^ static_cast<std::uint8_t>(bytes[i])) * 1099511628211ULL;
  }
  for (std::size_t i = 0; i < kChecksum; ++i) {
    bytes[bytes.size() - kChecksum + i] = static_cast<char>(hash >> (8 * i));
  }
  return bytes;
}

void vocabulary(std::string_view text) {
  try {
    const Vocabulary words = readVocabularyBytes("vocabulary", withChecksum(text));
    demand(words.words() > 0 && words.nodes() >= words.words());
    Descriptor descriptor;
    demand(words.word(descriptor) < words.words());
    descriptor.words.fill(0x0123456789ABCDEFULL);
    demand(words.weight(words.word(descriptor)) >= 0);
    Vocabulary again;
    demand(again.load(words.compact()).ok() && again.words() == words.words());
  } catch (const InputError&) {
  }
}

/// What was read is sane, solves without leaving the finite, and reads back equal.
template <typename Pose>
void demandSane(const G2oGraph& file, const PoseGraph<Pose>& graph) {
  demand(graph.poses.size() == file.ids.size());
  for (const auto& edge : graph.edges) {
    demand(edge.from < graph.poses.size() && edge.to < graph.poses.size() && edge.from != edge.to);
    demand(edge.information.allFinite() && edge.information.trace() > 0);
  }
  constexpr std::size_t kMostPoses = 200;  // larger ones say nothing new and take time
  if (graph.poses.size() > kMostPoses) return;
  PoseGraphOptimizer<Pose> optimizer({graph.poses.size(), graph.edges.size(), 0});
  StartReport start;
  OptimizeReport report;
  OptimizeEffort effort;
  effort.iterations = 3;
  if (!optimizer.assign(graph).ok() || !optimizer.start(start).ok()) return;
  if (optimizer.optimize(effort, report).ok() && std::isfinite(report.initial_cost)) {
    demand(report.final_cost <= report.initial_cost);
  }
  for (const Pose& pose : optimizer.graph().poses) demand(pose.translation.allFinite());
}

void g2o(std::string_view text) {
  try {
    const G2oFile file = readG2oBytes("graph.g2o", text);
    if (file.graph.planar) {
      demandSane(file.graph, file.graph.plane);
    } else {
      demandSane(file.graph, file.graph.space);
    }
    const std::string written = writeG2o(file.graph);
    G2oFile again = readG2oBytes("again.g2o", written);
    demand(again.report.clamped_information == 0 && writeG2o(again.graph) == written);
  } catch (const InputError&) {
  }
}

void keptGraph(std::string_view text) {
  std::vector<std::uint8_t> bytes(text.begin(), text.end());
  constexpr std::size_t kCrc = 4;
  for (const bool mended : {false, true}) {
    if (mended && bytes.size() >= kCrc) {
      const std::size_t covered = bytes.size() - kCrc;
      LittleFieldWriter({bytes.data() + covered, kCrc}).u32(crc32c(0, {bytes.data(), covered}));
    }
    try {
      const KeptGraph graph = readKeptGraph("graph.swg", bytes);
      for (const KeptNode& node : graph.nodes) demand(node.covariance.allFinite());
      for (const KeptLoop& loop : graph.loops) demand(loop.to < graph.nodes.size());
      demand(keptGraphBytes(graph) == bytes);
    } catch (const InputError&) {
    }
  }
}

/// A kept map's checksums, as far as lengths lead from record to record.
std::string withMapChecksums(std::string_view text) {
  constexpr std::size_t kHead = 96, kRecord = 12, kCrc = 4, kLengthAt = 8;  // docs/formats.md
  std::string bytes(text);
  auto* const data = reinterpret_cast<std::uint8_t*>(bytes.data());
  if (bytes.size() < kHead) return bytes;
  const std::uint32_t head = crc32c(0, {data, kHead - kCrc});
  LittleFieldWriter({data + kHead - kCrc, kCrc}).u32(head);
  for (std::size_t at = kHead; bytes.size() - at >= kRecord;) {
    const std::size_t length = LittleFieldReader({data + at + kLengthAt, sizeof(std::uint32_t)}).u32();
    if (length > bytes.size() - at - kRecord) break;
    LittleFieldWriter({data + at, kCrc}).u32(crc32c(head, {data + at + kCrc, kRecord - kCrc + length}));
    at += kRecord + length;
  }
  return bytes;
}

/// A map with room for few blocks, emptied before each use.
struct MapPlace {
  static VolumeSettings settings() {
    VolumeSettings settings;
    constexpr std::size_t kBytes = std::size_t{64} << 10U;
    settings.memory_bytes = kBytes;
    return settings;
  }
  KeptMapReport load(const std::string& bytes) {
    std::istringstream in(bytes);
    KeptMapReport report = checkKeptMap("map", in, volume.settings());
    volume.clear();
    loadKeptMap("map", in, volume, nullptr, report);
    return report;
  }
  std::string kept(const KeptMapReport& report) {
    std::ostringstream out;
    (void)writeKeptMap("map", out,
                       {volume, SurfaceSettings{}.least_weight, report.epoch, report.p_map_vehicle});
    return out.str();
  }
  VoxelVolume volume{settings()};
};

void keptMap(std::string_view text) {
  static MapPlace first, second;
  try {
    const KeptMapReport report = first.load(withMapChecksums(text));
    demand(report.without_room.blocks <= report.held.blocks);
    const std::string once = first.kept(report);
    demand(second.kept(second.load(once)) == once);
  } catch (const InputError&) {
  }
}

constexpr auto kTargets = std::to_array<NamedTarget>({{"imu_csv", &imuCsv},
                                                      {"image_csv", &imageCsv},
                                                      {"trajectory", &trajectory},
                                                      {"tracks", &tracks},
                                                      {"euroc_yaml", &eurocYaml},
                                                      {"kalibr_yaml", &kalibrYaml},
                                                      {"camera_files", &cameraFiles},
                                                      {"ros_message", &rosMessage},
                                                      {"mcap", &mcap},
                                                      {"ros1_bag", &ros1Bag},
                                                      {"rosbag2_metadata", &rosbag2Metadata},
                                                      {"recording", &recording},
                                                      {"gpmf", &gpmf},
                                                      {"phone_log", &phoneLog},
                                                      {"g2o", &g2o},
                                                      {"ply", &ply},
                                                      {"vocabulary", &vocabulary},
                                                      {"kept_map", &keptMap},
                                                      {"kept_graph", &keptGraph},
                                                      {"keyframes", &keyframes},
                                                      {"camera_frame", &cameraFrame},
                                                      {"topic_image", &topicImage},
                                                      {"dronecan", &dronecan},
                                                      {"vectornav_stream", &vectornavStream},
                                                      {"xsens_stream", &xsensStream},
                                                      {"mip_stream", &mipStream},
                                                      {"mavlink_stream", &mavlinkStream},
                                                      {"autopilot_stream", &autopilotStream},
                                                      {"bridge_stream", &bridgeStream},
                                                      {"clocks", &clocks},
                                                      {"faults", &faults}});

}  // namespace

std::span<const NamedTarget> targets() { return kTargets; }

}  // namespace swiftlet::fuzz
