#include "drivers/bag/sqlite_database.hpp"

#include <fmt/format.h>

#include <filesystem>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

[[noreturn]] void failWith(const std::string& name, const std::string& place, sqlite3* database) {
  const int code = sqlite3_errcode(database) & 0xFF;
  const bool damaged = code == SQLITE_CORRUPT || code == SQLITE_NOTADB;
  const bool full = code == SQLITE_FULL || code == SQLITE_IOERR;
  throw InputError(name, 0, place, std::string("SQLite error: ") + sqlite3_errmsg(database),
                   damaged ? "The file is damaged: copy it again, or recover the intact part with `sqlite3 "
                             "FILE .recover | sqlite3 NEW`"
                   : full  ? "Check that the disk is not full"
                           : "Check that it exists and that this user can read it and write beside it");
}

/// The path as a URI, with reserved characters escaped.
std::string uriOf(const std::string& path, bool alone) {
  std::string uri = "file:";
  for (const char c : std::filesystem::absolute(path).string()) {
    if (c == '?' || c == '#' || c == '%') {
      uri += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    } else {
      uri += c;
    }
  }
  return uri + (alone ? "?immutable=1" : "?mode=ro");
}

}  // namespace

SqliteStatement::SqliteStatement(sqlite3* database, const std::string& name, std::string_view text)
    : name_(name), database_(database), statement_(nullptr, &sqlite3_finalize) {
  sqlite3_stmt* made = nullptr;
  if (sqlite3_prepare_v2(database, text.data(), static_cast<int>(text.size()), &made, nullptr) != SQLITE_OK) {
    failWith(name_, "", database_);
  }
  statement_.reset(made);
}

bool SqliteStatement::step(const char* where, std::int64_t number) {
  const int result = sqlite3_step(statement_.get());
  if (result == SQLITE_ROW) return true;
  if (result == SQLITE_DONE) return false;
  failWith(name_, fmt::format("{} {}", where, number), database_);
}

void SqliteStatement::reset() { sqlite3_reset(statement_.get()); }

void SqliteStatement::bind(int parameter, std::int64_t value) {
  sqlite3_bind_int64(statement_.get(), parameter, value);
}
void SqliteStatement::bind(int parameter, std::string_view value) {
  sqlite3_bind_text64(statement_.get(), parameter, value.data(), value.size(), SQLITE_STATIC, SQLITE_UTF8);
}
void SqliteStatement::bind(int parameter, std::span<const std::uint8_t> value) {
  sqlite3_bind_blob64(statement_.get(), parameter, value.data(), value.size(), SQLITE_STATIC);
}

std::int64_t SqliteStatement::integer(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

std::string_view SqliteStatement::text(int column) const {
  const unsigned char* text = sqlite3_column_text(statement_.get(), column);
  if (text == nullptr) return {};
  return {reinterpret_cast<const char*>(text),
          static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

std::span<const std::uint8_t> SqliteStatement::blob(int column) const {
  const auto* bytes = static_cast<const std::uint8_t*>(sqlite3_column_blob(statement_.get(), column));
  if (bytes == nullptr) return {};
  return {bytes, static_cast<std::size_t>(sqlite3_column_bytes(statement_.get(), column))};
}

bool SqliteStatement::isBlob(int column) const {
  return sqlite3_column_type(statement_.get(), column) == SQLITE_BLOB;
}

SqliteDatabase::SqliteDatabase(const std::string& path, std::string name, Mode mode)
    : name_(std::move(name)), database_(nullptr, &sqlite3_close_v2) {
  namespace fs = std::filesystem;
  sqlite3* made = nullptr;
  int result = SQLITE_OK;
  if (mode == Mode::kCreate) {
    result = sqlite3_open_v2(path.c_str(), &made, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE, nullptr);
  } else {
    // Without a log beside it the file is opened as immutable, so that read-only folders work.
    const bool alone = !fs::exists(path + "-wal") && !fs::exists(path + "-journal");
    result =
        sqlite3_open_v2(uriOf(path, alone).c_str(), &made, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, nullptr);
  }
  database_.reset(made);
  if (result != SQLITE_OK) failWith(name_, "", database_.get());
}

SqliteStatement SqliteDatabase::prepare(std::string_view text) const {
  return {database_.get(), name_, text};
}

void SqliteDatabase::execute(const std::string& text) const {
  if (sqlite3_exec(database_.get(), text.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
    failWith(name_, "", database_.get());
  }
}

bool SqliteDatabase::hasTable(std::string_view table) const {
  SqliteStatement statement = prepare("SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ?");
  statement.bind(1, table);
  return statement.step("table", 0);
}

void SqliteDatabase::close() {
  if (sqlite3_close(database_.get()) != SQLITE_OK) failWith(name_, "", database_.get());
  (void)database_.release();
}

}  // namespace swiftlet
