#pragma once
// Makes rows of the registry from a group and its member.

#include "firmware_host/settings/registry.hpp"

namespace swiftlet {

/// Accessor for settings.*group.*member.
template <typename Group, typename Value>
auto member(Group Settings::*group, Value Group::*value) {
  return [group, value](Settings& settings) -> Value& { return settings.*group.*value; };
}

template <typename Group>
IntegerSetting integer(Group Settings::*group, int Group::*value, int low, int high) {
  return {member(group, value), low, high};
}

template <typename Group>
RealSetting real(Group Settings::*group, double Group::*value, double low, double high) {
  return {member(group, value), low, high};
}

template <typename Group>
SwitchSetting onOff(Group Settings::*group, bool Group::*value) {
  return {member(group, value)};
}

/// Settings of the connected devices: registry_devices.cpp.
std::vector<Setting> deviceSettings();

}  // namespace swiftlet
