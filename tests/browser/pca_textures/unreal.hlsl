// What Unreal makes of a Custom node: a function of the inputs, whose body is the code.
Texture2D<float4> Bound : register(t0);
cbuffer Frames : register(b0) { float Number; };
float3 CustomExpression(Texture2D<float4> Tex, float2 Place, float Frame, float Section)
{
#include "meshreel_pca.hlsl"
}
struct Seen
{
    float4 at : SV_Position;
    float3 position : TEXCOORD0;
    float3 normal : TEXCOORD1;
};
Seen main(float3 position : POSITION, float3 normal : NORMAL, float2 uv : TEXCOORD0)
{
    Seen seen;
    seen.position = position + CustomExpression(Bound, uv, Number, 0.0);
    seen.normal = normalize(normal + CustomExpression(Bound, uv, Number, 1.0));
    seen.at = float4(0.0, 0.0, 0.0, 1.0);
    return seen;
}
