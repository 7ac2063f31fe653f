#include "drivers/can/raw_imu.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "drivers/can/half_float.hpp"

namespace swiftlet {
namespace {

constexpr std::uint16_t kRawImuId = 1003;
constexpr std::uint64_t kRawImuSignature = 0x8280632C40E574B5ULL;
constexpr std::size_t kFixedBytes = 47;
constexpr std::size_t kMaxTerms = 36;
constexpr unsigned kCountBits = 6;
constexpr unsigned kTransferIds = 32;
// Means over a longer interval would smear motion; a longer value is not plausible.
constexpr float kLongestInterval = 1.0F;  // s
constexpr std::uint64_t kLargestStampUs =
    static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()) / 1000;
// Type and service bit of a broadcast id; the priority may be anything.
constexpr std::uint32_t kTypeMask = 0x00ffff80;

class Reader {
 public:
  explicit Reader(const std::uint8_t* at) : at_(at) {}
  std::uint64_t integer(unsigned bytes) {
    std::uint64_t value = 0;
    for (unsigned i = 0; i < bytes; ++i) value |= static_cast<std::uint64_t>(*at_++) << (8 * i);
    return value;
  }
  float single() { return std::bit_cast<float>(static_cast<std::uint32_t>(integer(4))); }
  Eigen::Vector3f halves() {
    Eigen::Vector3f v;
    for (float& x : v) x = fromHalf(static_cast<std::uint16_t>(integer(2)));
    return v;
  }
  Eigen::Vector3f singles() {
    Eigen::Vector3f v;
    for (float& x : v) x = single();
    return v;
  }

 private:
  const std::uint8_t* at_;
};

class Writer {
 public:
  explicit Writer(std::uint8_t* at) : at_(at) {}
  void integer(std::uint64_t value, unsigned bytes) {
    for (unsigned i = 0; i < bytes; ++i) *at_++ = static_cast<std::uint8_t>(value >> (8 * i));
  }
  void single(float value) { integer(std::bit_cast<std::uint32_t>(value), 4); }
  void halves(const Eigen::Vector3f& v) {
    for (const float x : v) integer(toHalf(x), 2);
  }
  void singles(const Eigen::Vector3f& v) {
    for (const float x : v) single(x);
  }

 private:
  std::uint8_t* at_;
};

}  // namespace

const DroneCanType& rawImuType() {
  static const DroneCanType kType = dronecanType(kRawImuId, kRawImuSignature);
  return kType;
}

bool decodeRawImu(std::span<const std::uint8_t> payload, bool fd, RawImu& out) {
  if (payload.size() < kFixedBytes + (fd ? 1 : 0)) return false;
  Reader reader(payload.data());
  out.stamp_us = reader.integer(7);
  out.interval = reader.single();
  out.rate = reader.halves();
  out.rate_integral = reader.singles();
  out.force = reader.halves();
  out.force_integral = reader.singles();
  const std::span<const std::uint8_t> rest = payload.subspan(kFixedBytes);
  const std::size_t terms = fd ? rest[0] >> (8 - kCountBits) : rest.size() / 2;
  const std::size_t needed = fd ? (kCountBits + 16 * terms + 7) / 8 : 2 * terms;
  if (terms > kMaxTerms || rest.size() < needed || (!fd && rest.size() != needed)) return false;
  out.covariance_count = terms;
  for (std::size_t i = 0; i < terms; ++i) {
    const std::size_t at = 2 * i;
    std::uint32_t low = rest[at];
    std::uint32_t high = rest[at + 1];
    if (fd) {
      // The count's 6 bits shift all values: 2 bits come from one byte and 6 from the next.
      low = (low << kCountBits | high >> (8 - kCountBits)) & 0xffU;
      high = (high << kCountBits | static_cast<std::uint32_t>(rest[at + 2] >> (8 - kCountBits))) & 0xffU;
    }
    out.covariance[i] = fromHalf(static_cast<std::uint16_t>(low | high << 8U));
  }
  return true;
}

std::size_t encodeRawImu(const RawImu& imu, bool fd, std::span<std::uint8_t, kMaxRawImuBytes> out) {
  std::fill(out.begin(), out.end(), std::uint8_t{0});
  Writer writer(out.data());
  writer.integer(imu.stamp_us, 7);
  writer.single(imu.interval);
  writer.halves(imu.rate);
  writer.singles(imu.rate_integral);
  writer.halves(imu.force);
  writer.singles(imu.force_integral);
  const std::size_t terms = std::min(imu.covariance_count, kMaxTerms);
  if (fd) out[kFixedBytes] = static_cast<std::uint8_t>(terms << (8 - kCountBits));
  for (std::size_t i = 0; i < terms; ++i) {
    const std::uint32_t half = toHalf(imu.covariance[i]);
    std::uint8_t* at = out.data() + kFixedBytes + 2 * i;
    for (const unsigned byte : {half & 0xffU, half >> 8U}) {
      if (fd) {
        at[0] = static_cast<std::uint8_t>(at[0] | byte >> kCountBits);
        at[1] = static_cast<std::uint8_t>(byte << (8 - kCountBits));
      } else {
        at[0] = static_cast<std::uint8_t>(byte);
      }
      ++at;
    }
  }
  return kFixedBytes + 2 * terms + (fd ? 1 : 0);
}

bool RawImuDecoder::take(const CanFrame& frame, ImuReading& out) {
  if (frame.extended) {
    const DroneCanId id = dronecanId(frame.id);
    if (!id.service && id.node != 0 && id.type == kGlobalTimeSyncType) ++counters_.time_syncs;
  }
  DroneCanTransfer transfer;
  if (!reassembler_.take(frame, transfer)) return false;
  if (node_ != 0 && transfer.node != node_) {
    ++counters_.other_nodes;
    return false;
  }
  RawImu imu;
  if (!decodeRawImu(transfer.payload, transfer.fd, imu)) {
    ++counters_.malformed;
    return false;
  }
  const bool integrated = imu.interval > 0;
  const Eigen::Vector3f& rate = integrated ? imu.rate_integral : imu.rate;
  const Eigen::Vector3f& force = integrated ? imu.force_integral : imu.force;
  const double scale = integrated ? 1.0 / static_cast<double>(imu.interval) : 1.0;
  out.gyro = rate.cast<double>() * scale;
  out.accel = force.cast<double>() * scale;
  const bool interval_ok = std::isfinite(imu.interval) && imu.interval <= kLongestInterval;
  if (!interval_ok || !out.gyro.allFinite() || !out.accel.allFinite() || imu.stamp_us > kLargestStampUs) {
    ++counters_.not_finite;
    return false;
  }
  node_ = transfer.node;
  counter_ += counting_ ? (transfer.transfer_id + kTransferIds - transfer_id_) % kTransferIds : 0U;
  counting_ = true;
  transfer_id_ = transfer.transfer_id;
  out.arrival = transfer.arrival;
  out.counter = counter_;
  out.device.reset();
  if (imu.stamp_us != 0) out.device = Stamp{static_cast<std::int64_t>(imu.stamp_us) * 1000};
  ++counters_.readings;
  return true;
}

void RawImuDecoder::addFilters(CanBusSettings& settings) {
  settings.addFilter({static_cast<std::uint32_t>(kRawImuId) << 8U, kTypeMask});
  settings.addFilter({static_cast<std::uint32_t>(kGlobalTimeSyncType) << 8U, kTypeMask});
}

}  // namespace swiftlet
