#pragma once
// The definition of a message as the text of its .msg file followed by the definitions of all nested types,
// as bags store it: each of these is preceded by a line of 80 `=` and a line `MSG: package/Type`.

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "drivers/bag/bag_file.hpp"
#include "drivers/bag/ros_messages.hpp"

namespace swiftlet {

template <bool kIsRos1>
class DefinitionWriter {
 public:
  static constexpr bool kRos1 = kIsRos1;

  template <typename T>
  void operator()(const char* name, const T& /*value*/) {
    text_ += typeName<T>() + " " + name + "\n";
    note<T>();
  }
  void constant(const char* type, const char* name, int value) {
    text_ += std::string(type) + " " + name + "=" + std::to_string(value) + "\n";
  }

  template <rosmsg::Message T>
  std::string definition() {
    describe<T>();
    std::string all = std::move(text_);
    for (std::size_t i = 0; i < others_.size(); ++i) {
      text_.clear();
      others_[i].describe(*this);
      all += std::string(80, '=') + "\nMSG: " + others_[i].type + "\n" + text_;
    }
    return all;
  }

 private:
  struct Other {
    std::string type;
    void (*describe)(DefinitionWriter&);
  };

  template <rosmsg::Message T>
  void describe() {
    if constexpr (requires(DefinitionWriter & self) { T::constants(self); }) T::constants(*this);
    const T message;
    T::fields(message, *this);
  }

  template <typename T>
  struct Array : std::false_type {};
  template <typename T>
  struct Array<std::vector<T>> : std::true_type {
    using Element = T;
    static std::string size() { return ""; }
  };
  template <typename T, std::size_t kCount>
  struct Array<std::array<T, kCount>> : std::true_type {
    using Element = T;
    static std::string size() { return std::to_string(kCount); }
  };
  template <typename T>
  struct Array<std::span<const T>> : std::true_type {
    using Element = T;
    static std::string size() { return ""; }
  };

  template <typename T>
  static std::string typeName() {
    if constexpr (rosmsg::Message<T>) return T::kType;
    if constexpr (Array<T>::value)
      return typeName<typename Array<T>::Element>() + "[" + Array<T>::size() + "]";
    if constexpr (std::is_same_v<T, Stamp>) return kRos1 ? "time" : "builtin_interfaces/Time";
    if constexpr (std::is_same_v<T, rosmsg::Duration>)
      return kRos1 ? "duration" : "builtin_interfaces/Duration";
    if constexpr (std::is_same_v<T, rosmsg::Byte>) return "byte";
    if constexpr (std::is_same_v<T, std::string>) return "string";
    if constexpr (std::is_same_v<T, bool>) return "bool";
    if constexpr (std::is_floating_point_v<T>) return "float" + std::to_string(8 * sizeof(T));
    if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>) {
      return (std::is_signed_v<T> ? "int" : "uint") + std::to_string(8 * sizeof(T));
    }
  }

  /// Collects the definition of each nested type once.
  template <typename T>
  void note() {
    if constexpr (Array<T>::value) {
      note<typename Array<T>::Element>();
    } else if constexpr (rosmsg::Message<T>) {
      add({T::kType, [](DefinitionWriter& self) { self.describe<T>(); }});
    } else if constexpr (!kRos1 && std::is_same_v<T, Stamp>) {
      add({"builtin_interfaces/Time",
           [](DefinitionWriter& self) { self.text_ += "int32 sec\nuint32 nanosec\n"; }});
    } else if constexpr (!kRos1 && std::is_same_v<T, rosmsg::Duration>) {
      add({"builtin_interfaces/Duration",
           [](DefinitionWriter& self) { self.text_ += "int32 sec\nuint32 nanosec\n"; }});
    }
  }
  void add(Other other) {
    for (const Other& known : others_) {
      if (known.type == other.type) return;
    }
    others_.push_back(std::move(other));
  }

  std::string text_;
  std::vector<Other> others_;
};

template <rosmsg::Message T>
[[nodiscard]] std::string definitionOf(BagEncoding encoding) {
  if (encoding == BagEncoding::kRos1) return DefinitionWriter<true>().definition<T>();
  return DefinitionWriter<false>().definition<T>();
}

}  // namespace swiftlet
