// Transfers recorded with other implementations, frame by frame and byte by byte.
#include <catch2/catch.hpp>

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "drivers/can/raw_imu.hpp"
#include "drivers/device/crc16.hpp"

namespace swiftlet {
namespace {

using nlohmann::json;

json golden() {
  std::ifstream file(SWIFTLET_TEST_DATA "/protocols/dronecan.json");
  REQUIRE(file);
  return json::parse(file)["frames"];
}

std::vector<std::uint8_t> bytesOf(const std::string& hex) {
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoul(hex.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

CanFrame frameOf(const json& pair, bool fd, std::int64_t stamp) {
  CanFrame frame;
  frame.id = static_cast<std::uint32_t>(std::stoul(pair[0].get<std::string>(), nullptr, 16));
  const std::vector<std::uint8_t> bytes = bytesOf(pair[1]);
  REQUIRE(bytes.size() <= CanFrame::kMaxBytes);
  std::copy(bytes.begin(), bytes.end(), frame.data.begin());
  frame.size = static_cast<std::uint8_t>(bytes.size());
  frame.fd = fd;
  frame.arrival = {stamp};
  return frame;
}

std::vector<double> numbers(const json& list) { return list.get<std::vector<double>>(); }

void compare(const Eigen::Vector3f& v, const json& expected) {
  for (int i = 0; i < 3; ++i)
    CHECK(static_cast<double>(v[i]) == numbers(expected)[static_cast<std::size_t>(i)]);
}

void compare(const RawImu& imu, const json& values) {
  CHECK(imu.stamp_us == values["timestamp_usec"].get<std::uint64_t>());
  CHECK(static_cast<double>(imu.interval) == values["integration_interval"].get<double>());
  compare(imu.rate, values["rate_gyro_latest"]);
  compare(imu.rate_integral, values["rate_gyro_integral"]);
  compare(imu.force, values["accelerometer_latest"]);
  compare(imu.force_integral, values["accelerometer_integral"]);
  const std::vector<double> covariance = numbers(values["covariance"]);
  REQUIRE(imu.covariance_count == covariance.size());
  for (std::size_t i = 0; i < covariance.size(); ++i) {
    CHECK(static_cast<double>(imu.covariance[i]) == covariance[i]);
  }
}

struct Delivered {
  std::uint8_t node = 0;
  std::uint8_t transfer_id = 0;
  RawImu imu;
  std::vector<std::uint8_t> payload;
  std::int64_t arrival = 0;
};

std::vector<Delivered> deliver(const json& entry) {
  DroneCanReassembler reassembler(rawImuType());
  std::vector<Delivered> all;
  std::int64_t stamp = 1000;
  for (const json& pair : entry["sequence"]) {
    DroneCanTransfer transfer;
    if (!reassembler.take(frameOf(pair, entry.value("fd", false), ++stamp), transfer)) continue;
    Delivered one = {transfer.node, transfer.transfer_id, {}, {}, transfer.arrival.ns};
    REQUIRE(decodeRawImu(transfer.payload, transfer.fd, one.imu));
    one.payload.assign(transfer.payload.begin(), transfer.payload.end());
    all.push_back(one);
  }
  return all;
}

bool isRawImu(const json& entry) { return entry["name"] != "dc_globaltimesync"; }

TEST_CASE("The type's checksum is the published one", "[can]") {
  CHECK(rawImuType().id == 1003);
  CHECK(rawImuType().crc == 0x4E3E);
  const std::string digits = "123456789";
  CHECK(crc16Ccitt(0xffff, {reinterpret_cast<const std::uint8_t*>(digits.data()), digits.size()}) == 0x29B1);
}

TEST_CASE("Recorded RawIMU transfers come out with every value exact; damaged ones do not come out",
          "[can]") {
  int compared = 0;
  const json recorded = golden();
  for (const json& entry : recorded) {
    if (!isRawImu(entry)) continue;
    INFO(entry["name"]);
    const std::vector<Delivered> all = deliver(entry);
    if (!entry["valid"].get<bool>()) {
      CHECK(all.empty());
    } else if (entry.contains("values_list")) {
      REQUIRE(all.size() == entry["values_list"].size());
      for (const Delivered& one : all) {
        bool found = false;
        for (const json& values : entry["values_list"]) {
          if (values["source_node"].get<int>() != one.node) continue;
          compare(one.imu, values);
          found = true;
        }
        CHECK(found);
      }
    } else {
      REQUIRE(all.size() == 1);
      compare(all[0].imu, entry["values"]);
      if (entry.contains("source_node")) CHECK(all[0].node == entry["source_node"].get<int>());
      if (entry.contains("transfer_id")) CHECK(all[0].transfer_id == entry["transfer_id"].get<int>());
      if (entry.contains("payload")) {
        const std::vector<std::uint8_t> payload = bytesOf(entry["payload"]);
        REQUIRE(all[0].payload.size() >= payload.size());
        CHECK(std::equal(payload.begin(), payload.end(), all[0].payload.begin()));
        CHECK(all[0].arrival == 1001);  // of the first frame
      }
    }
    ++compared;
  }
  CHECK(compared >= 11);
}

TEST_CASE("Encoded from the recorded values, transfers are the recorded ones byte for byte", "[can]") {
  int compared = 0;
  const json recorded = golden();
  for (const json& entry : recorded) {
    if (!isRawImu(entry) || !entry.contains("payload")) continue;
    INFO(entry["name"]);
    const bool fd = entry["fd"];
    const RawImu imu = deliver(entry).at(0).imu;
    std::array<std::uint8_t, kMaxRawImuBytes> bytes = {};
    const std::size_t size = encodeRawImu(imu, fd, bytes);
    const std::vector<std::uint8_t> payload = bytesOf(entry["payload"]);
    CHECK(std::vector<std::uint8_t>(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size)) ==
          payload);
    DroneCanFrames frames;
    REQUIRE(encodeTransfer(rawImuType(), entry["priority"].get<std::uint8_t>(),
                           entry["source_node"].get<std::uint8_t>(), entry["transfer_id"].get<unsigned>(), fd,
                           {bytes.data(), size}, frames));
    REQUIRE(frames.count == entry["sequence"].size());
    for (std::size_t i = 0; i < frames.count; ++i) {
      const CanFrame expected = frameOf(entry["sequence"][i], fd, 0);
      CHECK(frames.frames[i].id == expected.id);
      CHECK(std::vector<std::uint8_t>(frames.frames[i].bytes().begin(), frames.frames[i].bytes().end()) ==
            std::vector<std::uint8_t>(expected.bytes().begin(), expected.bytes().end()));
    }
    ++compared;
  }
  CHECK(compared == 6);
}

TEST_CASE("Readings are means over the interval, or the newest where there is none", "[can]") {
  std::map<std::string, ImuReading> readings;
  const json recorded = golden();
  for (const json& entry : recorded) {
    RawImuDecoder decoder;
    ImuReading reading;
    std::int64_t stamp = 0;
    for (const json& pair : entry["sequence"]) {
      if (decoder.take(frameOf(pair, entry.value("fd", false), ++stamp), reading)) {
        readings[entry["name"]] = reading;
      }
    }
    if (!isRawImu(entry)) CHECK(decoder.counters().time_syncs == 1);
  }
  for (const char* name : {"dc_rawimu_classic", "dc_rawimu_fd"}) {
    INFO(name);
    REQUIRE(readings.count(name) == 1);
    const ImuReading& mean = readings[name];
    CHECK(mean.gyro.x() == Approx(0.5).epsilon(1e-6));
    CHECK(mean.accel.z() == Approx(-9.8125).epsilon(1e-6));
    CHECK(mean.device == Stamp{1234567890123000});
    CHECK(mean.arrival == Stamp{1});
  }
  REQUIRE(readings.count("dc_rawimu_no_integral") == 1);
  const ImuReading& newest = readings["dc_rawimu_no_integral"];
  CHECK(newest.gyro == Eigen::Vector3d(0.5, -0.25, 0.125));
  CHECK(newest.accel == Eigen::Vector3d(0.25, -0.5, -9.8125));
  CHECK(!newest.device);
}

}  // namespace
}  // namespace swiftlet
