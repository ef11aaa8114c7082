// Reads tables of numbers. Memory is a pointer, or whatever ArrayTraits::gather takes; Value is what it holds at an index: a
// number or, in a shader, a texel of several.
#ifndef CUTICLE_MATH_TABLE_VALUES_H
#define CUTICLE_MATH_TABLE_VALUES_H

#include "cuticle/math/functions.h"

namespace cuticle {

// A channel between two of a table's, for an absorption between theirs; a channel of the table itself is an int.
template <class Float> struct ChannelBetween {
    typename ArrayTraits<Float>::Index first;  // the other is first + 1
    Float t;
};

template <class Value, class Memory, class Index>
CUTICLE_INLINE Value channel_value(const Memory &data, const Index &first, int channel) {
    return Value(ArrayTraits<Value>::gather(data, Index(first + Index(channel))));
}
template <class Value, class Memory, class Index, class Float>
CUTICLE_INLINE Value channel_value(const Memory &data, const Index &first, const ChannelBetween<Float> &channel) {
    const Index lower = first + channel.first;
    return math::linear(channel_value<Value>(data, lower, 0), channel_value<Value>(data, lower, 1),
                        math::clamp(channel.t, Float(0), Float(1)));
}

// What stands `column` values into the rows of a table, `size` values each from `first` on; linear between two rows.
template <class Value, class Float, class Memory, class Index, class Channel>
CUTICLE_INLINE Value between_rows(const Memory &data, const Index &first, const Place<Float> &row, int size, int column,
                                  const Channel &channel) {
    const Index lower = first + row.node * Index(size) + Index(column), upper = lower + Index(size);
    return math::linear(channel_value<Value>(data, lower, channel), channel_value<Value>(data, upper, channel), row.t);
}

// Linear between two rows and two columns; `t` and `u` are the fractions towards the next of each.
template <class Value, class Float, class Memory, class Index, class Channel>
CUTICLE_INLINE Value bilinear_value(const Memory &data, const Index &first, int row, int column, const Float &t,
                                    const Float &u, const Channel &channel) {
    const Index lower = first, upper = lower + Index(row), next = Index(column);
    return math::bilinear(
        channel_value<Value>(data, lower, channel), channel_value<Value>(data, Index(lower + next), channel),
        channel_value<Value>(data, upper, channel), channel_value<Value>(data, Index(upper + next), channel), t, u);
}

}  // namespace cuticle

#endif  // CUTICLE_MATH_TABLE_VALUES_H
