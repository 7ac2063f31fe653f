#include "drivers/recorded/csv_reader.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>

#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

// A few bad rows are damage; more than this number and share mean another format.
constexpr std::uint64_t kToleratedBadRows = 3;
constexpr std::uint64_t kToleratedBadShare = 10;  // one in ten
constexpr std::size_t kMaxQuoted = 40;            // characters of bad input repeated in a message

std::string_view trim(std::string_view text) {
  constexpr std::string_view kBlank = " \t\r\n\v\f";
  const std::size_t first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

}  // namespace

std::string quoteInput(std::string_view text) {
  std::string out = "`";
  for (const char c : text.substr(0, kMaxQuoted)) out += (c >= ' ' && c < 127) ? c : '?';
  return out + (text.size() > kMaxQuoted ? "...`" : "`");
}

CsvReader::Separator CsvReader::separatorOfText(std::string_view text) {
  constexpr std::size_t kProbedBytes = 4096;
  text = text.substr(0, kProbedBytes);
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    const std::string_view line = text.substr(0, end);
    const std::size_t first = line.find_first_not_of(" \t\r\xEF\xBB\xBF");
    const bool data = first != std::string_view::npos && line[first] >= '+' && line[first] <= '9';
    if (data) return line.find(',') == std::string_view::npos ? Separator::kBlank : Separator::kComma;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return Separator::kBlank;
}

CsvReader::Separator CsvReader::separatorOf(const std::string& path) {
  std::array<char, kMaxLine> head{};
  std::ifstream probe(path, std::ios::binary);
  probe.read(head.data(), head.size());
  return separatorOfText({head.data(), static_cast<std::size_t>(probe.gcount())});
}

CsvReader::CsvReader(const std::string& path, Separator separator, LogCounters& counters,
                     LogWarnings& warnings)
    : name_(path),
      separator_(separator),
      counters_(&counters),
      warnings_(&warnings),
      file_(std::fopen(path.c_str(), "rb")) {
  if (!file_) {
    throw InputError(path, 0, "", std::string("cannot be read: ") + std::strerror(errno),
                     "Check that it exists and this user can read it");
  }
}

CsvReader::CsvReader(const std::string& name, std::string_view text, Separator separator,
                     LogCounters& counters, LogWarnings& warnings)
    : name_(name), separator_(separator), counters_(&counters), warnings_(&warnings), rest_(text) {}

bool CsvReader::readLine() {
  overlong_ = false;
  std::size_t length = 0;
  if (file_) {
    if (std::fgets(buffer_.data(), static_cast<int>(buffer_.size()), file_.get()) == nullptr) {
      if (std::ferror(file_.get()) == 0) return false;
      throw InputError(name_, 0, "", std::string("cannot be read: ") + std::strerror(errno),
                       "Copy the file to a working disk");
    }
    length = ::strnlen(buffer_.data(), buffer_.size());
    if (length + 1 == buffer_.size() && buffer_[length - 1] != '\n') {
      overlong_ = true;
      for (int c = std::fgetc(file_.get()); c != '\n' && c != EOF;) c = std::fgetc(file_.get());
    }
    text_ = std::string_view(buffer_.data(), length);
  } else {
    if (rest_.empty()) return false;
    length = std::min(rest_.find('\n'), rest_.size());
    text_ = rest_.substr(0, length);
    overlong_ = length >= kMaxLine;
    rest_.remove_prefix(std::min(length + 1, rest_.size()));
  }
  ++line_;
  if (line_ == 1 && text_.starts_with("\xEF\xBB\xBF")) text_.remove_prefix(3);
  if (line_ == 1 && (text_.starts_with("\xFF\xFE") || text_.starts_with("\xFE\xFF"))) {
    throw InputError(name_, 0, "", "is UTF-16 text",
                     "Save it as UTF-8: `iconv -f UTF-16 -t UTF-8`, or choose UTF-8 where the file is saved");
  }
  text_ = trim(text_);
  return true;
}

void CsvReader::split() {
  size_ = 0;
  std::string_view rest = text_;
  const std::string_view separators = separator_ == Separator::kComma ? "," : " \t,";
  while (size_ < kMaxFields) {
    const std::size_t end = rest.find_first_of(separators);
    const std::string_view field = trim(rest.substr(0, end));
    if (separator_ == Separator::kComma || !field.empty()) fields_[size_++] = field;
    if (end == std::string_view::npos) return;
    rest.remove_prefix(end + 1);
  }
}

bool CsvReader::isHeader() const {
  double value = 0;
  return rows_ == 0 && bad_ == 0 && header_.empty() && !parseDouble(fields_[0], value) &&
         !fields_[0].empty() && (fields_[0][0] < '0' || fields_[0][0] > '9');
}

bool CsvReader::next(std::size_t min_fields) {
  while (readLine()) {
    if (text_.empty()) continue;
    if (text_.front() == '#') {
      if (header_.empty()) {
        header_ = text_.substr(0, kMaxLine);
        header_line_ = line_;
      }
      continue;
    }
    split();
    if (!overlong_ && isHeader()) {
      header_ = text_;
      header_line_ = line_;
      continue;
    }
    ++rows_;
    if (overlong_) {
      reject("row", "the line is longer than 4095 bytes");
    } else if (size_ < min_fields) {
      reject("row", std::to_string(size_) + " fields where " + std::to_string(min_fields) + " are expected");
    } else {
      return true;
    }
  }
  return false;
}

bool CsvReader::number(std::size_t i, const char* name, double& value) {
  if (!parseDouble(field(i), value)) {
    reject(name, quoteInput(field(i)) + " is not a number");
    return false;
  }
  if (std::isfinite(value)) return true;
  ++nan_;
  if (!first_bad_) first_bad_ = error(name, quoteInput(field(i)) + " is not finite", "");
  warnings_->addCounted(++counters_->nan_rows,
                        error(name, quoteInput(field(i)) + ", row skipped", "").what());
  return false;
}

bool CsvReader::numbers(std::size_t first, std::span<const char* const> names, double* values) {
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (!number(first + k, names[k], values[k])) return false;
  }
  return true;
}

bool CsvReader::integer(std::size_t i, const char* name, std::int64_t& value) {
  if (parseInteger(field(i), value)) return true;
  reject(name, quoteInput(field(i)) + " is not a whole number");
  return false;
}

void CsvReader::reject(const char* field_name, const std::string& message) {
  ++bad_;
  if (!first_bad_) first_bad_ = error(field_name, message, "");
  warnings_->addCounted(++counters_->bad_rows, error(field_name, message + ", row skipped", "").what());
}

void CsvReader::finish(const char* what, const char* remedy) const {
  const std::uint64_t unusable = bad_ + nan_;
  const bool none = rows_ == unusable;
  const bool too_many = unusable > kToleratedBadRows && unusable * kToleratedBadShare > rows_;
  if (!none && !too_many) return;
  if (!first_bad_) throw InputError(name_, 0, "", std::string("holds no ") + what, remedy);
  throw InputError(name_, first_bad_->line, first_bad_->field,
                   first_bad_->message + "; " + std::to_string(unusable) + " of " + std::to_string(rows_) +
                       " rows are not " + what,
                   remedy);
}

InputError CsvReader::error(const char* field_name, const std::string& message,
                            const std::string& remedy) const {
  return {name_, line_, field_name, message, remedy};
}

}  // namespace swiftlet
