#include "tests/fuzz/fuzz_keyframes.hpp"

#include <algorithm>
#include <sstream>
#include <string>

#include "drivers/device/byte_fields.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/recorded/recording_checksum.hpp"
#include "estimator/smoother/full_smoother.hpp"
#include "firmware_host/smoothing/keyframe_reader.hpp"
#include "tests/fuzz/demand.hpp"

namespace swiftlet::fuzz {
namespace {

using namespace keyframe_file;  // NOLINT(google-build-using-namespace)

/// As far as lengths lead from record to record.
std::string withChecksums(std::string_view text) {
  std::string bytes(text);
  auto* const data = reinterpret_cast<std::uint8_t*>(bytes.data());
  if (bytes.size() < kPrefixBytes) return bytes;
  const std::size_t head = LittleFieldReader({data + kPrefixBytes - 4, 4}).u32();
  if (head < kCrcBytes || head > bytes.size() - kPrefixBytes) return bytes;
  const std::size_t covered = kPrefixBytes + head - kCrcBytes;
  const std::uint32_t of_head = crc32c(0, {data, covered});
  LittleFieldWriter({data + covered, kCrcBytes}).u32(of_head);
  for (std::size_t at = kPrefixBytes + head; bytes.size() - at >= kRecordBytes;) {
    const std::size_t length = LittleFieldReader({data + at + 8, 4}).u32();
    if (length > bytes.size() - at - kRecordBytes) break;
    const std::uint32_t crc = crc32c(of_head, {data + at + kCrcBytes, kRecordBytes - kCrcBytes + length});
    LittleFieldWriter({data + at, kCrcBytes}).u32(crc);
    at += kRecordBytes + length;
  }
  return bytes;
}

void read(const std::string& bytes) {
  std::istringstream in(bytes);
  try {
    KeyframeReader reader("keyframes.swk", in);
    FullSmoother smoother(reader.rig(), reader.noise(), {.max_iterations = 2});
    for (KeyframeReader::Next next{}; (next = reader.next()) != KeyframeReader::Next::kEnd;) {
      if (next == KeyframeReader::Next::kSample) {
        demand(reader.sample().gyro.allFinite() && reader.sample().accel.allFinite());
        smoother.addImu(reader.sample());
      } else if (next == KeyframeReader::Next::kKeyframe) {
        demand(reader.state().T_world_body.translation.allFinite());
        demand(reader.noiseInUse().pixel_sigma > 0 && reader.noiseInUse().imu.gyro > 0);
        smoother.addKeyframe(reader.frame(), reader.state(), reader.noiseInUse());
      } else if (next == KeyframeReader::Next::kCalibration) {
        demand(reader.calibration().T_body_cam[0].translation.allFinite());
        smoother.setCalibration(reader.calibration());
      } else {
        demand(reader.revisit().information.allFinite());
        (void)smoother.addRevisit(reader.revisit());
      }
    }
    demand(reader.next() == KeyframeReader::Next::kEnd);
    demand(smoother.memoryNeeded() > 0);
    FullSmootherReport report;
    (void)smoother.solve(report);
  } catch (const InputError&) {
  }
}

}  // namespace

void keyframes(std::string_view text) {
  read(std::string(text));
  read(withChecksums(text));
}

}  // namespace swiftlet::fuzz
