"""What can be said of SPIR-V without a driver: whether it is valid, what it asks for, and what becomes of it in Metal."""
import collections
import re
import subprocess
from dataclasses import dataclass, field

# MSL 2.3, which all Macs with macOS 11 have.
METAL = "20300"

# Functions of Metal's standard library, keywords that stand before a parenthesis, and types. What else the translation calls and does
# not define is GLSL that the translator left as it was.
KNOWN = set("""
abs all any asin atan atan2 ceil clamp cos cross ctz clz dot exp exp2 extract_bits floor fma fract insert_bits isinf isnan length log log2 max
min mix mulhi normalize popcount pow reflect refract reverse_bits round rsqrt select sign sin smoothstep sqrt step tan transpose trunc
unpack_unorm2x16_to_float unpack_unorm4x8_to_float pack_float_to_unorm2x16 pack_float_to_unorm4x8 threadgroup_barrier simdgroup_barrier
simd_all simd_any simd_ballot simd_broadcast simd_shuffle simd_shuffle_xor simd_sum simd_prefix_exclusive_sum simd_prefix_inclusive_sum
atomic_load_explicit atomic_store_explicit atomic_exchange_explicit atomic_fetch_add_explicit atomic_fetch_or_explicit atomic_fetch_and_explicit
atomic_fetch_max_explicit atomic_fetch_min_explicit atomic_compare_exchange_weak_explicit buffer function_constant is_function_constant_defined
while for if switch return sizeof as_type int uint short bool float int2 int3 int4 uint2 uint3 uint4 float2 float3 float4 bool2 bool3 bool4
float2x2 float3x3 float4x4 T tmp
""".split())


@dataclass
class Translation:
    refused: list = field(default_factory=list)  # reasons, a line each
    emulated: list = field(default_factory=list)  # helper functions of the translator
    macros: list = field(default_factory=list)  # specialisation constants that Metal cannot specialise


def called(command):
    done = subprocess.run(command, capture_output=True, text=True, errors="replace")
    return done.returncode, done.stdout, [line for line in done.stderr.splitlines() if line.strip()]


def invalid(path):
    """What spirv-val finds wrong."""
    code, out, said = called(["spirv-val", "--target-env", "vulkan1.2", str(path)])
    return said or ([] if code == 0 else [out.strip() or f"spirv-val ends with {code}"])


def traits(path):
    """Names of coherent buffers, capabilities beside Shader, and the subgroup operations of a module."""
    _, text, _ = called(["spirv-dis", "--no-color", "--no-header", str(path)])
    coherent = set(re.findall(r"Op(?:Member)?Decorate %(\w+)(?: \d+)? Coherent", text))
    operations = set(re.findall(r"OpGroupNonUniform(\w+)", text))
    capabilities = set(re.findall(r"OpCapability (\w+)", text)) - {"Shader"}
    return sorted(coherent), sorted(capabilities), sorted(operations)


def to_metal(path, constants):
    code, text, said = called(["spirv-cross", str(path), "--msl", "--msl-version", METAL])
    found = Translation(refused=said or ([] if code == 0 else [f"spirv-cross ends with {code}"]))
    # Attributes too, whose parentheses would be taken for the function's.
    text = re.sub(r"//.*|__attribute__\(\(\w+\)\)", "", text)
    defined = set(re.findall(r"\b(\w+)\s*\([^;{}]*\)[\w\s]*\{", text)) | set(re.findall(r"struct (\w+)", text))
    unknown = sorted(set(re.findall(r"\b([A-Za-z_]\w*)\s*\(", text)) - defined - KNOWN)
    found.refused += [f"no such function in Metal: {name}" for name in unknown]
    # Once is the definition alone.
    helpers = collections.Counter(re.findall(r"\b(spv[A-Z]\w*)\s*\(", text))
    found.emulated = sorted(name for name, times in helpers.items() if times > 1 and name != "spvUnsafeArray")
    by_number = {number: name for name, number in constants.items()}
    found.macros = [by_number[int(number)] for number in sorted(set(re.findall(r"#ifndef SPIRV_CROSS_CONSTANT_ID_(\d+)", text)))]
    return found
