// Decoders stand on the flight path: nothing is allocated between the first byte and the last.

#include <memory>

#include "tests/drivers/recorded/recording_allocations.hpp"
#include "tests/drivers/serial/decoding.hpp"

namespace swiftlet::test {
namespace {

TEST_CASE("Decoding and encoding allocate nothing", "[serial]") {
  for (const ImuProtocol protocol : kProtocols) {
    INFO(name(protocol));
    std::array<std::uint8_t, ImuEncoder::kLongestFrame> bytes = {};
    ImuEncoder encoder(protocol);
    ImuDecoder decoder(protocol);
    std::size_t readings = 0;
    const std::uint64_t before = allocationCount();
    for (int i = 0; i < 5000; ++i) {
      const std::size_t length = encoder.encode(readingNumber(i), bytes);
      // Every ninth is damaged: refusals are on the path, too.
      if (i % 9 == 8) bytes[length / 2] ^= 0xFF;
      const std::size_t taken = decoder.feed(std::span(bytes).first(length), Stamp{i}, kByteTime);
      if (taken != length) break;
      ImuReading reading;
      while (decoder.next(reading)) ++readings;
    }
    const std::uint64_t after = allocationCount();
    CHECK(after == before);
    CHECK(readings == 5000 - 5000 / 9);
  }
  // The count counts.
  const std::uint64_t before = allocationCount();
  const auto proof = std::make_unique<Bytes>(10);
  CHECK(allocationCount() >= before + 2);
}

}  // namespace
}  // namespace swiftlet::test
