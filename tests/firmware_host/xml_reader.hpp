#pragma once
// A small strict reader of XML: elements, attributes, text, the five entities and character references.
// It refuses what is not well-formed, so that a test of a writer can fail.

#include <cctype>
#include <cstdlib>
#include <map>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace swiftlet {

struct XmlElement {
  std::string name;
  std::map<std::string, std::string> attributes;
  std::vector<XmlElement> children;
  std::string text;  ///< of its own, children's not included

  [[nodiscard]] std::vector<const XmlElement*> all(const std::string& wanted) const {
    std::vector<const XmlElement*> found;
    for (const XmlElement& child : children) {
      if (child.name == wanted) found.push_back(&child);
      for (const XmlElement* below : child.all(wanted)) found.push_back(below);
    }
    return found;
  }
};

class XmlReader {
 public:
  static XmlElement read(std::string_view text) {
    XmlReader reader(text);
    if (reader.rest().starts_with("<?xml")) reader.skipPast("?>");
    reader.space();
    XmlElement root = reader.element();
    reader.space();
    if (!reader.rest().empty()) throw std::runtime_error("text after the root element");
    return root;
  }

 private:
  explicit XmlReader(std::string_view text) : text_(text) {}

  [[nodiscard]] std::string_view rest() const { return text_.substr(at_); }
  char next() {
    if (at_ >= text_.size()) throw std::runtime_error("the text ends within an element");
    return text_[at_++];
  }
  void expect(std::string_view word) {
    if (!rest().starts_with(word)) throw std::runtime_error("expected " + std::string(word));
    at_ += word.size();
  }
  void skipPast(std::string_view word) {
    const std::size_t found = text_.find(word, at_);
    if (found == std::string_view::npos) throw std::runtime_error("expected " + std::string(word));
    at_ = found + word.size();
  }
  void space() {
    while (at_ < text_.size() && std::isspace(static_cast<unsigned char>(text_[at_])) != 0) ++at_;
  }
  std::string name() {
    std::string word;
    while (at_ < text_.size() && (std::isalnum(static_cast<unsigned char>(text_[at_])) != 0 ||
                                  text_[at_] == '-' || text_[at_] == '_' || text_[at_] == ':')) {
      word += text_[at_++];
    }
    if (word.empty() || std::isdigit(static_cast<unsigned char>(word[0])) != 0) {
      throw std::runtime_error("no name where one must be");
    }
    return word;
  }
  /// One character, decoded; it began with `first`.
  std::string character(char first) {
    const auto byte = static_cast<unsigned char>(first);
    if (byte < 0x20 && first != '\n' && first != '\t' && first != '\r') {
      throw std::runtime_error("a control character");
    }
    if (first == '<') throw std::runtime_error("a bare <");
    if (first != '&') return {first};
    std::string entity;
    for (char c = next(); c != ';'; c = next()) {
      entity += c;
      if (entity.size() > 8) throw std::runtime_error("a bare &");
    }
    if (entity == "amp") return "&";
    if (entity == "lt") return "<";
    if (entity == "gt") return ">";
    if (entity == "quot") return "\"";
    if (entity == "apos") return "'";
    if (entity.size() < 2 || entity[0] != '#') throw std::runtime_error("unknown entity " + entity);
    return {static_cast<char>(std::atoi(entity.c_str() + 1))};
  }
  XmlElement element() {
    XmlElement element;
    expect("<");
    element.name = name();
    for (;;) {
      const bool apart = std::isspace(static_cast<unsigned char>(rest().empty() ? '\0' : rest()[0])) != 0;
      space();
      if (rest().starts_with("/>")) {
        at_ += 2;
        return element;
      }
      if (rest().starts_with(">")) break;
      if (!apart) throw std::runtime_error("attributes run together");
      const std::string key = name();
      expect("=\"");
      std::string value;
      for (char c = next(); c != '"'; c = next()) value += character(c);
      if (!element.attributes.emplace(key, value).second) throw std::runtime_error(key + " given twice");
    }
    expect(">");
    while (!rest().starts_with("</")) {
      if (rest().starts_with("<")) {
        element.children.push_back(this->element());
      } else {
        element.text += character(next());
      }
    }
    expect("</");
    if (name() != element.name) throw std::runtime_error(element.name + " is closed by another name");
    space();
    expect(">");
    return element;
  }

  std::string_view text_;
  std::size_t at_ = 0;
};

}  // namespace swiftlet
