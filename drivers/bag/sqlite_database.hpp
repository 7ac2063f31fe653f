#pragma once
// SQLite handles with RAII; errors are InputError.

#include <sqlite3.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

namespace swiftlet {

class SqliteStatement {
 public:
  SqliteStatement(sqlite3* database, const std::string& name, std::string_view text);
  /// True while there are rows. `where` and `number` locate an error in its message.
  bool step(const char* where, std::int64_t number);
  void reset();

  void bind(int parameter, std::int64_t value);
  /// Text and bytes must outlive the next step().
  void bind(int parameter, std::string_view value);
  void bind(int parameter, std::span<const std::uint8_t> value);
  [[nodiscard]] std::int64_t integer(int column) const;
  [[nodiscard]] std::string_view text(int column) const;
  [[nodiscard]] std::span<const std::uint8_t> blob(int column) const;
  [[nodiscard]] bool isBlob(int column) const;

 private:
  std::string name_;
  sqlite3* database_;
  std::unique_ptr<sqlite3_stmt, int (*)(sqlite3_stmt*)> statement_;
};

class SqliteDatabase {
 public:
  enum class Mode : std::uint8_t { kRead, kCreate };
  /// kRead: includes a write-ahead log beside the file (`-wal`). `name` names the file in messages.
  SqliteDatabase(const std::string& path, std::string name, Mode mode);

  [[nodiscard]] SqliteStatement prepare(std::string_view text) const;
  void execute(const std::string& text) const;
  [[nodiscard]] bool hasTable(std::string_view table) const;
  /// For writers: remaining write errors are reported here.
  void close();

 private:
  std::string name_;
  std::unique_ptr<sqlite3, int (*)(sqlite3*)> database_;
};

}  // namespace swiftlet
