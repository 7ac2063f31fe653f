// Where the live view is served, and to whom.

#include <catch2/catch.hpp>

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/view/view_address.hpp"
#include "tests/support/input_error.hpp"

namespace swiftlet {
namespace {

TEST_CASE("an address is loopback unless told otherwise") {
  CHECK(parseViewAddress("").text() == "127.0.0.1:8320");
  CHECK(parseViewAddress("9000").text() == "127.0.0.1:9000");
  CHECK(parseViewAddress(":0").text() == "127.0.0.1:0");
  CHECK(parseViewAddress("0.0.0.0").text() == "0.0.0.0:8320");
  CHECK(parseViewAddress("192.168.1.7:80").text() == "192.168.1.7:80");
  CHECK(parseViewAddress("localhost:80").text() == "localhost:80");
  CHECK(parseViewAddress("[::1]:80").text() == "[::1]:80");
  CHECK(parseViewAddress("::1").text() == "[::1]:8320");
}

TEST_CASE("what is no address is refused with the option's name and a remedy") {
  for (const char* text :
       {"data/euroc_mh01_20s", "127.0.0.1:66000", "127.0.0.1:-1", "127.0.0.1:x", "[::1", "1.2.3.4.5"}) {
    CAPTURE(text);
    const InputError error = test::errorOf([&] { parseViewAddress(text); });
    CHECK(error.file == "--view");
    CHECK(error.field == text);
    CHECK_FALSE(error.remedy.empty());
  }
}

TEST_CASE("only this host reaches loopback") {
  for (const char* host : {"127.0.0.1", "127.1.2.3", "::1", "localhost"})
    CHECK(ViewAddress{host}.isLoopback());
  for (const char* host : {"0.0.0.0", "::", "192.168.1.7", "128.0.0.1", "::ffff:10.0.0.1"})
    CHECK_FALSE(ViewAddress{host}.isLoopback());
}

TEST_CASE("pages from elsewhere get no answer") {
  const ViewAddress address;
  CHECK(viewMayAnswer(address, "127.0.0.1:8320", ""));
  CHECK(viewMayAnswer(address, "localhost:8320", "http://localhost:8320"));
  CHECK(viewMayAnswer(address, "[::1]:8320", ""));
  CHECK(viewMayAnswer(address, "192.168.1.7:8320", ""));
  // A name that leads here is somebody else's.
  CHECK_FALSE(viewMayAnswer(address, "evil.example:8320", ""));
  CHECK_FALSE(viewMayAnswer(address, "evil.example", "http://evil.example"));
  CHECK_FALSE(viewMayAnswer(address, "", ""));
  // A page from elsewhere that asks by number says where it is from.
  CHECK_FALSE(viewMayAnswer(address, "127.0.0.1:8320", "http://evil.example"));
  CHECK_FALSE(viewMayAnswer(address, "127.0.0.1:8320", "null"));
}

}  // namespace
}  // namespace swiftlet
