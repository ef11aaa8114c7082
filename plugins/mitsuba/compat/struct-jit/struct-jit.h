// Stands in for a header that Mitsuba's wheel includes and leaves out: names only, nothing here is ever constructed.
#pragma once

#include <cstdint>

namespace struct_jit {

enum class Type { Invalid, Int8, UInt8, Int16, UInt16, Int32, UInt32, Int64, UInt64, Float16, Float32, Float64 };

template <class T> struct type_id {
    static constexpr Type value = Type::Invalid;
};
template <> struct type_id<float> {
    static constexpr Type value = Type::Float32;
};
template <> struct type_id<double> {
    static constexpr Type value = Type::Float64;
};
template <> struct type_id<std::uint8_t> {
    static constexpr Type value = Type::UInt8;
};
template <> struct type_id<std::uint16_t> {
    static constexpr Type value = Type::UInt16;
};
template <> struct type_id<std::uint32_t> {
    static constexpr Type value = Type::UInt32;
};
template <class T> inline constexpr Type type_v = type_id<T>::value;

class Struct;

}  // namespace struct_jit
