// Figures over time in bounded memory.

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>

#include "firmware_host/outputs/view/live_table.hpp"

namespace swiftlet {
namespace {

TEST_CASE("a table over hours stays bounded, covers the whole time and keeps its newest rows") {
  LiveTable table(2);
  constexpr int kRows = 20 * 3600;  // an hour
  for (int i = 0; i < kRows; ++i) {
    table.add(std::array{0.05F * static_cast<float>(i), static_cast<float>(i)});
    REQUIRE(table.rows() <= LiveTable::kMost);
  }
  const auto time = table.column(0);
  CHECK(time.front() == 0);
  CHECK(time.back() == Approx(0.05 * (kRows - 1)));
  float widest = 0;
  for (std::size_t i = 1; i < time.size(); ++i) {
    REQUIRE(time[i] > time[i - 1]);
    widest = std::max(widest, time[i] - time[i - 1]);
  }
  // Stretches are at most twice as long as need be, and neighbours at most two of them apart.
  CHECK(widest < 3600.0F / (LiveTable::kMost / 2) * 4.1F);
  // Columns stay beside each other.
  for (std::size_t i = 0; i < time.size(); i += 100)
    CHECK(table.column(1)[i] == Approx(time[i] / 0.05F).margin(0.6));
}

TEST_CASE("thinning keeps what the judged column has highest") {
  LiveTable table(2, 1);
  for (int i = 0; i < 10000; ++i) {
    table.add(std::array{static_cast<float>(i), i == 777 ? 50.0F : 1.0F});
  }
  const auto values = table.column(1);
  CHECK(std::ranges::count(values, 50.0F) == 1);
}

TEST_CASE("a table knows what was sent, and that a thinned one has to be sent anew") {
  LiveTable table(2);
  table.add(std::array{0.0F, 1.0F});
  CHECK(table.unsent() == 0);
  table.sent();
  CHECK(table.unsent() == 1);
  table.add(std::array{0.0F, 2.0F});  // time does not rise
  CHECK(table.rows() == 1);
  for (int i = 1; i <= static_cast<int>(LiveTable::kMost); ++i)
    table.add(std::array{static_cast<float>(i), 0.0F});
  CHECK(table.replaced());
  CHECK(table.unsent() == 0);
  table.sent();
  CHECK_FALSE(table.replaced());
  CHECK(table.unsent() == table.rows());
}

}  // namespace
}  // namespace swiftlet
