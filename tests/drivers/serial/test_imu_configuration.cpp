// Bytes that set a sensor's output, beside frames that were computed by hand from the manuals, and what is
// made of the answers.

#include <catch2/catch.hpp>

#include <string>

#include "drivers/serial/imu_configuration.hpp"
#include "tests/drivers/serial/decoding.hpp"

namespace swiftlet::test {
namespace {

Bytes stepBytes(const ConfigurationStep& step) { return {step.bytes.begin(), step.bytes.end()}; }
std::string textOf(const ConfigurationStep& step) { return {step.bytes.begin(), step.bytes.end()}; }

TEST_CASE("VectorNav: 800 Hz divided, the XOR of the line at its end", "[serial]") {
  const ImuConfiguration at400(ImuProtocol::kVectorNav, 400);
  REQUIRE(at400.steps() == 1);
  CHECK(textOf(at400.step(0)) == "$VNWRG,75,3,2,01,0201*77\r\n");
  CHECK(textOf(ImuConfiguration(ImuProtocol::kVectorNav, 200).step(0)) == "$VNWRG,75,3,4,01,0201*71\r\n");
  ImuConfiguration odd(ImuProtocol::kVectorNav, 300);
  odd.answered(0, {});
  CHECK(odd.rate() == Approx(800.0 / 3));
}

TEST_CASE("Xsens: the output is set between two changes of state, and read back", "[serial]") {
  ImuConfiguration xsens(ImuProtocol::kXsens, 400);
  REQUIRE(xsens.steps() == 3);
  CHECK(stepBytes(xsens.step(0)) == Bytes{0xFA, 0xFF, 0x30, 0x00, 0xD1});
  CHECK(stepBytes(xsens.step(1)) == Bytes{0xFA, 0xFF, 0xC0, 0x10, 0x10, 0x20, 0xFF, 0xFF, 0x10, 0x60, 0xFF,
                                          0xFF, 0x40, 0x20, 0x01, 0x90, 0x80, 0x20, 0x01, 0x90, 0x73});
  CHECK(stepBytes(xsens.step(2)) == Bytes{0xFA, 0xFF, 0x10, 0x00, 0xF1});
  for (std::size_t i = 0; i < 3; ++i)
    CHECK(Xsens::check(stepBytes(xsens.step(i))).verdict == FrameVerdict::kWhole);
  Bytes answer = stepBytes(xsens.step(1));
  answer[2] = 0xC1;
  answer[14] = 0x00;  // 100 Hz is what it can
  answer[15] = 0x64;
  xsens.answered(1, answer);
  CHECK(xsens.rate() == 100);
}

TEST_CASE("MIP: the base rate is asked for and divided", "[serial]") {
  ImuConfiguration mip(ImuProtocol::kMip, 250);
  REQUIRE(mip.steps() == 5);
  for (std::size_t i = 0; i < 5; ++i)
    CHECK(Mip::check(stepBytes(mip.step(i))).verdict == FrameVerdict::kWhole);
  CHECK(stepBytes(mip.step(0)) == Bytes{0x75, 0x65, 0x01, 0x02, 0x02, 0x02, 0xE1, 0xC7});
  CHECK(stepBytes(mip.step(2)) == Bytes{0x75, 0x65, 0x0C, 0x0E, 0x0E, 0x0F, 0x01, 0x80, 0x03, 0xD5,
                                        0x00, 0x01, 0x04, 0x00, 0x01, 0x05, 0x00, 0x01, 0x76, 0x62});
  CHECK(stepBytes(mip.step(3)) == Bytes{0x75, 0x65, 0x0C, 0x05, 0x05, 0x11, 0x01, 0x80, 0x01, 0x83, 0x18});
  CHECK(stepBytes(mip.step(4)) == Bytes{0x75, 0x65, 0x01, 0x02, 0x02, 0x06, 0xE5, 0xCB});
  const Bytes answer = {0x04, 0xF1, 0x0E, 0x00, 0x05, 0x8E, 0x80, 0x03, 0xE8};  // 1000 Hz
  REQUIRE(mip.step(1).answer_length == answer.size());
  mip.answered(1, answer);
  CHECK(mip.rate() == 250);
  CHECK(stepBytes(mip.step(2))[11] == 4);
  CHECK(stepBytes(mip.step(2))[14] == 4);
  CHECK(stepBytes(mip.step(2))[17] == 4);
}

TEST_CASE("Bridges and autopilots are not set by these bytes", "[serial]") {
  CHECK(ImuConfiguration(ImuProtocol::kBridge, 400).steps() == 0);
  CHECK(ImuConfiguration(ImuProtocol::kMavlink, 400).steps() == 0);
}

}  // namespace
}  // namespace swiftlet::test
