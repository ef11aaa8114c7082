"""Words that a name in an export may not be, by language, and beginnings that a language keeps for itself.

Sources: C++23 [lex.key], [reserved.names], [zombie.names]; what <cmath>, <cstdint>, <cstdlib> and <cstring> of glibc 2.36
declare outside `std`; the CUDA C++ Programming Guide's extensions; pbrt-v4's sources; GLSL 4.60 and GLSL ES 3.20,
section 3.6; the HLSL reference's keywords and reserved words; the Slang
language reference; WGSL, sections 15.1 and 15.2; the Metal
Shading Language Specification.
"""

from __future__ import annotations

_C = """
    auto bool break case char const constexpr continue default do double else enum extern false float for goto if inline
    int long nullptr register return short signed sizeof static static_assert struct switch thread_local true typedef
    typeof typeof_unqual union unsigned void volatile while
"""
_LIBRARY = """
    a64l abort abs acos acosh aligned_alloc arc4random arc4random_buf arc4random_uniform asin asinh assert at_quick_exit
    atan atan2 atanh atexit atof atoi atol basename bcmp bcopy bsearch bzero calloc canonicalize canonicalize_file_name
    cbrt ceil clearenv clock copysign cos cosh ctime daddl ddivl dfmal div dmull drand48 drand48_data drem dsqrtl dsubl
    ecvt erand48 erf erfc errno exit exp exp10 exp2 explicit_bzero expm1 fabs fadd far fcvt fd_mask fd_set fdim fdiv ffma
    ffs ffsl ffsll finite floor fma fmax fmaximum fmaximum_mag fmaximum_mag_num fmaximum_num fmaxmag fmin fminimum
    fminimum_mag fminimum_mag_num fminimum_num fminmag fmod fmul fopen fpclassify fprintf free frexp fromfp fromfpx
    fscanf fsqrt fsub gamma gcvt getenv getloadavg getpayload getpt getsubopt gmtime grantpt hypot ilogb index initstate
    iscanonical iseqsig isfinite isinf isnan isnormal issignaling iszero j0 j1 jn jrand48 l64a labs lcong48 ldexp ldiv
    lgamma linux llabs lldiv llogb llrint llround localtime log log10 log1p log2 logb longjmp lrand48 lrint lround main
    malloc max mblen mbstowcs mbtowc memccpy memchr memcmp memcpy memfrob memmem memmove mempcpy memrchr memset min
    mkdtemp mkostemp mkostemp64 mkostemps mkostemps64 mkstemp mkstemp64 mkstemps mkstemps64 mktemp mktime modf mrand48
    nan near nearbyint nextafter nextdown nexttoward nextup nrand48 offsetof on_exit perror posix posix_memalign
    posix_openpt pow printf pselect ptsname putchar putenv puts qecvt qfcvt qgcvt qsort quick_exit raise rand random
    random_data rawmemchr realloc reallocarray realpath remainder remove remquo rename rewind rindex rint round roundeven
    rpmatch scalb scalbln scalbn scanf secure_getenv seed48 select setenv setjmp setpayload setpayloadsig setstate
    sigabbrev sigdescr signal signbit signgam significand sin sincos sinh sprintf sqrt srand srand48 srandom stderr stdin
    stdout stpcpy stpncpy strcasecmp strcasestr strcat strchr strchrnul strcmp strcoll strcpy strcspn strdup strerror
    strerrordesc strerrorname strfrom strfromd strfry strlen strncasecmp strncat strncmp strncpy strndup strnlen strpbrk
    strrchr strsep strsignal strspn strstr strto strtod strtok strtol strtold strtoll strtoq strtoul strtoull strtouq
    strverscmp strxfrm system tan tanh tgamma time timespec timeval totalorder totalordermag trunc u_char u_int u_long
    u_short ufromfp ufromfpx uint ulong unix unlockpt unsetenv ushort valloc wcstombs wctomb y0 y1 yn EOF INFINITY NAN
    NDEBUG NULL
"""
_CPP = """
    alignas alignof and and_eq asm atomic_cancel atomic_commit atomic_noexcept bitand bitor catch char8_t char16_t
    char32_t class co_await co_return co_yield compl concept const_cast consteval constinit contract_assert decltype
    delete dynamic_cast explicit export final friend import module mutable namespace new noexcept not not_eq operator or
    or_eq override private protected public reflexpr reinterpret_cast requires static_cast synchronized template this
    throw try typeid typename using virtual wchar_t xor xor_eq
"""
_CUDA = """
    blockDim blockIdx char1 char2 char3 char4 cuda dim3 double1 double2 double3 double4 float1 float2 float3 float4
    gridDim int1 int2 int3 int4 long1 long2 nv nvcuda threadIdx thrust uchar uint uint1 uint2 uint3 uint4 ulong ushort
    warpSize
"""
_GLSL = """
    active asm atomic_uint attribute bool break buffer bvec2 bvec3 bvec4 case cast centroid class coherent common const
    continue default demote discard dmat2 dmat3 dmat4 do double dvec2 dvec3 dvec4 else enum extern external false filter
    fixed flat float for fvec2 fvec3 fvec4 goto half highp hvec2 hvec3 hvec4 if iimage2D image2D image3D imageCube in
    inline inout input int interface invariant isampler2D isampler3D isamplerCube ivec2 ivec3 ivec4 layout long lowp
    main mat2 mat2x2 mat2x3 mat2x4 mat3 mat3x2 mat3x3 mat3x4 mat4 mat4x2 mat4x3 mat4x4 mediump namespace noinline
    noperspective out output partition patch precise precision public readonly resource restrict return sample sampler
    sampler1D sampler2D sampler2DArray sampler2DRect sampler3D sampler3DRect samplerBuffer samplerCube shared short
    sizeof smooth static struct subroutine superp switch template texture texture2D this true typedef uimage2D uint
    uniform union unsigned usampler2D usampler3D usamplerCube using uvec2 uvec3 uvec4 varying vec2 vec3 vec4 void
    volatile while writeonly
"""
_SLANG = """
    __exported __global __init __subscript __target_intrinsic as associatedtype borrow bwd_diff dyn each enum_class expand
    extension func functype fwd_diff get import implementing instance interface internal is let module none no_diff
    nullptr optional property public set some spirv_asm T This typealias var where select
"""
_HLSL = """
    AppendStructuredBuffer Buffer ByteAddressBuffer ConstantBuffer RWBuffer RWStructuredBuffer RWTexture2D SamplerState
    StructuredBuffer Texture1D Texture2D Texture3D TextureCube asm auto bool break case catch cbuffer centroid char
    class column_major compile const const_cast continue default delete discard do double dword dynamic_cast else enum
    explicit export extern false fixed float for friend fxgroup globallycoherent goto groupshared half if in inline
    inout int interface line lineadj linear long main matrix min10float min12int min16float min16int min16uint mutable
    namespace new nointerpolation noperspective operator out packoffset pass pixelfragment point precise private
    protected public register reinterpret_cast return row_major sample sampler shared short signed sizeof snorm
    stateblock static static_cast string struct switch tbuffer technique template texture this throw triangle
    triangleadj true try typedef typename uint uniform union unorm unsigned using vector vertexfragment virtual void
    volatile while
"""
_WGSL = """
    alias break case const const_assert continue continuing default diagnostic discard else enable false fn for if let loop
    override requires return struct switch true var while
    NULL Self abstract active alignas alignof as asm asm_fragment async attribute auto await become binding_array cast catch
    class co_await co_return co_yield coherent column_major common compile compile_fragment concept const_cast consteval
    constexpr constinit crate debugger decltype delete demote demote_to_helper do dynamic_cast enum explicit export extends
    extern external fallthrough filter final finally friend from fxgroup get goto groupshared highp impl implements import
    inline instanceof interface layout lowp macro macro_rules match mediump meta mod module move mut mutable namespace new
    nil noexcept noinline nointerpolation non_coherent noncoherent noperspective null nullptr of operator package packoffset
    partition pass patch pixelfragment precise precision premerge priv protected pub public readonly ref regardless register
    reinterpret_cast require resource restrict self set shared sizeof smooth snorm static static_assert static_cast std
    subroutine super target template this thread_local throw trait try type typedef typeid typename typeof union unless
    unorm unsafe unsized use using varying virtual volatile wgsl where with writeonly yield
"""
_METAL = """
    constant device fragment half intersection kernel mesh metal object object_data patch_control_point ray_data sampler
    simd texture texture2d thread threadgroup threadgroup_imageblock uchar uint ulong ushort vertex visible
"""
_NUMBERS = {f"{kind}{n}" for kind in ("bool", "int", "uint", "half", "float", "double") for n in (1, 2, 3, 4)}
_MATRICES = {
    f"{kind}{m}x{n}" for kind in ("bool", "int", "uint", "half", "float", "double") for m in range(1, 5) for n in range(1, 5)
}

# Macros of the headers that exported C++ includes, as glibc has them: a compiler puts their text in place of the word.
_MACROS = """
    EDOM EILSEQ ERANGE ULLONG_MAX ULONG_MAX USHRT_MAX BIG_ENDIAN BYTE_ORDER LITTLE_ENDIAN PDP_ENDIAN MAXFLOAT MB_CUR_MAX
    NFDBITS RAND_MAX WCONTINUED WEXITED WEXITSTATUS WNOHANG WNOWAIT WSTOPPED WSTOPSIG WTERMSIG WUNTRACED alloca be16toh
    be32toh be64toh htobe16 htobe32 htobe64 htole16 htole32 htole64 issubnormal le16toh le32toh le64toh math_errhandling
    strdupa strndupa
"""
PREFIXES = (
    *("EXIT_", "FD_", "FP_", "HUGE_VAL", "INT", "M_", "MATH_ERR", "PTRDIFF_", "SIG_ATOMIC_", "SIZE_", "SNAN", "UINT"),
    *("WCHAR_", "WIF", "WINT_", "CHAR_", "DBL_", "FLT_", "LDBL_", "LLONG_", "LONG_", "SCHAR_", "SHRT_", "UCHAR_"),
    *("f32", "f64", "pthread_"),  # functions between formats, as f32addf64, and threads
)

# pbrt-v4's materials (materials.cpp), its headers in src/pbrt, where an export's header goes, and its namespaces.
_PBRT = """
    coatedconductor coateddiffuse conductor dielectric diffuse diffusetransmission hair interface measured mix none
    subsurface thindielectric
    bsdf bssrdf bxdfs cameras film filters interaction lights lightsamplers materials media options paramdict parser ray
    samplers scene shapes textures
    pbrt pstd
"""

ENDINGS = ("_t",)  # types, POSIX 2.2.2

# The library's functions for other formats of numbers, with a locale, for threads, and of GNU alone.
_FORMATS = ("", "f", "l", "f32", "f32x", "f64", "f64x", "f128")
_VARIANTS = [f + number + end for f in _LIBRARY.split() for number in _FORMATS for end in ("", "_l", "_r", "_np")]

OURS = frozenset({"cuticle"})
CPP = frozenset((_C + _CPP + _MACROS).split()) | frozenset(_VARIANTS) | {"std", *(f"std{n}" for n in range(10))}
CUDA = CPP | frozenset(_CUDA.split())
PBRT = CPP | frozenset(_PBRT.split())
GLSL = frozenset(_GLSL.split())
HLSL = frozenset(_HLSL.split()) | _NUMBERS | _MATRICES
SLANG = HLSL | frozenset(_SLANG.split())
WGSL = frozenset(_WGSL.split())
METAL = frozenset((_C + _CPP + _METAL).split()) | _NUMBERS | _MATRICES | {"std"}
