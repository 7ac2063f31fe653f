// The map's blocks on disk while a run goes on.

#include "firmware_host/outputs/map_files/block_file.hpp"

#include <array>
#include <catch2/catch.hpp>
#include <filesystem>

#include "tests/firmware_host/file_size_limit.hpp"
#include "tests/firmware_host/scratch_folder.hpp"

using namespace swiftlet;

namespace {

using Bytes = std::array<std::byte, 1000>;

Bytes filled(int value) {
  Bytes bytes;
  bytes.fill(static_cast<std::byte>(value));
  return bytes;
}

}  // namespace

TEST_CASE("blocks come back as they were written, anew in their place too, and no file is left behind") {
  const ScratchFolder folder("blocks");
  BlockFile file(folder.file(""));
  Bytes out{};
  CHECK_FALSE(file.read(0, out));
  for (int i = 0; i < 10; ++i) REQUIRE(file.write(1000U * static_cast<unsigned>(i), filled(i)));
  REQUIRE(file.write(3000, filled(77)));
  for (int i = 0; i < 10; ++i) {
    REQUIRE(file.read(1000U * static_cast<unsigned>(i), out));
    CHECK(out == filled(i == 3 ? 77 : i));
  }
  CHECK_FALSE(file.read(9500, out));
  CHECK(std::filesystem::is_empty(folder.file("")));
}

TEST_CASE("a folder that is not there refuses every block, a full disk those beyond") {
  BlockFile nowhere("/nowhere/at/all");
  CHECK_FALSE(nowhere.write(0, filled(1)));
  CHECK_FALSE(nowhere.write(0, filled(1)));
  const ScratchFolder folder("blocks");
  BlockFile file(folder.file(""));
  Bytes out{};
  {
    const FileSizeLimit limit(4500);
    for (unsigned i = 0; i < 4; ++i) CHECK(file.write(1000 * i, filled(1)));
    CHECK_FALSE(file.write(4000, filled(2)));
  }
  CHECK(file.read(3000, out));
  CHECK(out == filled(1));
}
