// What ReelPlayer.cs uses of UnityEngine, to compile it and to run it without Unity.

using System;
using System.Collections.Generic;

namespace UnityEngine
{
    public sealed class RequireComponent : Attribute { public RequireComponent(Type one, Type other) { } }
    public sealed class TooltipAttribute : Attribute { public TooltipAttribute(string text) { } }

    public struct Vector2
    {
        public float x, y;
        public Vector2(float x, float y) { this.x = x; this.y = y; }
    }

    public struct Vector3
    {
        public float x, y, z;
        public Vector3(float x, float y, float z) { this.x = x; this.y = y; this.z = z; }
    }

    public struct Bounds
    {
        public Vector3 center, size;
        public Bounds(Vector3 center, Vector3 size) { this.center = center; this.size = size; }
    }

    public class Object
    {
        public string name;
        public static readonly List<Object> Destroyed = new List<Object>();
        public static void Destroy(Object one) => Destroyed.Add(one);
    }

    public class TextAsset : Object { public byte[] bytes; }
    public class MeshRenderer : Object { }
    public class MeshFilter : Object { public Mesh mesh; }

    public class MonoBehaviour : Object
    {
        public MeshFilter Filter = new MeshFilter();
        public T GetComponent<T>() where T : Object => (T)(Object)Filter;
    }

    public sealed class GameObject : Object { public T AddComponent<T>() where T : Object, new() => new T(); }
    public static class Time { public static float deltaTime; }
    public static class Application { public static string streamingAssetsPath = "/nowhere"; }

    public sealed class Mesh : Object
    {
        private Vector3[] shown;
        public readonly Dictionary<int, int[]> Triangles = new Dictionary<int, int[]>();
        public Vector3[] normals;
        public Vector2[] uv;
        public Bounds bounds;
        public int subMeshCount;
        public Rendering.IndexFormat indexFormat;
        public int Shows;

        /// <summary>Copies, as Unity does.</summary>
        public Vector3[] vertices
        {
            get { return shown; }
            set
            {
                shown = (Vector3[])value.Clone();
                Shows++;
            }
        }

        public void MarkDynamic() { }
        public void SetTriangles(int[] triangles, int submesh, bool calculateBounds) => Triangles[submesh] = triangles;

        public void Clear()
        {
            shown = normals = null;
            uv = null;
            Triangles.Clear();
        }
    }
}

namespace UnityEngine.Rendering
{
    public enum IndexFormat { UInt16, UInt32 }
}
