// Plays a file with ReelPlayer.cs and stubs of Unity: `Play ahead|direct|backwards|"as it is" FILE` prints what is shown,
// `Play at FILE SECONDS...` the frames at these times.

using System;
using System.Linq;
using System.Reflection;
using System.Security.Cryptography;
using System.Threading;
using Meshreel;
using UnityEngine;

internal static class Play
{
    private static readonly ReelPlayer player = new ReelPlayer();

    private static int Main(string[] words)
    {
        bool backwards = words[0] == "backwards";
        player.speed = backwards ? -1 : 1;
        player.loadAhead = backwards || words[0] == "ahead";
        player.mirror = words[0] != "as it is";
        player.threads = words[0] == "ahead" ? 2 : 1;
        player.asset = player.mirror ? new TextAsset { bytes = System.IO.File.ReadAllBytes(words[1]) } : null;
        player.path = words[1];
        try
        {
            Send("Start");
            if (words[0] == "at")
            {
                Console.WriteLine("{0} {1}", player.duration, string.Join(" ", words.Skip(2).Select(FrameAt)));
                return 0;
            }
            int n = player.Info.FrameCount;
            double fps = player.Info.Fps > 0 ? player.Info.Fps : player.defaultFps;
            Time.deltaTime = 0;
            player.time = backwards ? (n - 0.5) / fps : 0;
            for (int i = 0; i < n + 2; i++)
            {
                Print((backwards ? 2 * n - 1 - i : i) % n);
                Time.deltaTime = (float)(1.001 / fps); // not short of a frame where it is rounded
                Send("Update");
                Time.deltaTime = 0;
            }
            player.Pause();
            foreach (int frame in new[] { n - 1, 0, n - 2 })
            {
                player.time = frame / fps;
                Print(frame);
            }
            player.loop = false;
            player.Play();
            Time.deltaTime = 1000;
            Send("Update");
            Print(backwards ? 0 : n - 1);
            Need(!player.isPlaying && player.time == (backwards ? 0 : player.duration), "it stops at the end");
            Send("OnDestroy");
            Need(UnityEngine.Object.Destroyed.Single() is Mesh && player.Info == null, "all is released");
        }
        catch (ReelException failure)
        {
            Console.WriteLine("failed {0}, {1}", failure.Code, player.Info == null ? "closed" : "open");
        }
        return 0;
    }

    private static int FrameAt(string seconds)
    {
        player.time = double.Parse(seconds, System.Globalization.CultureInfo.InvariantCulture);
        Send("Update");
        return player.frame;
    }

    private static void Need(bool holds, string what)
    {
        if (!holds)
        {
            throw new Exception("broken: " + what);
        }
    }

    /// <summary>Call what Unity calls, which is private.</summary>
    private static void Send(string message)
    {
        try
        {
            typeof(ReelPlayer).GetMethod(message, BindingFlags.Instance | BindingFlags.NonPublic).Invoke(player, null);
        }
        catch (TargetInvocationException failure) when (failure.InnerException is ReelException)
        {
            throw failure.InnerException;
        }
    }

    /// <summary>Wait for a frame, and print it corner by corner.</summary>
    private static void Print(int frame)
    {
        for (int i = 0; i < 10000 && player.frame != frame; i++)
        {
            Send("Update");
            Thread.Sleep(i == 0 ? 0 : 1);
        }
        Need(player.frame == frame, "frame " + frame + " is shown, not " + player.frame);
        Mesh mesh = player.Filter.mesh;
        using (ReelFile file = ReelFile.Open(player.path))
        {
            int[] corners = Enumerable.Range(0, mesh.subMeshCount).SelectMany(i => mesh.Triangles[i]).ToArray();
            Console.WriteLine("{0} {1} {2} {3} {4} {5}", frame, file.SegmentOfFrame(frame), corners.Distinct().Count(),
                Hash(corners.SelectMany(i => Three(mesh.vertices[i]))), Hash(corners.SelectMany(i => Three(mesh.normals[i]))),
                mesh.uv == null ? "-" : Hash(corners.SelectMany(i => new[] { mesh.uv[i].x, mesh.uv[i].y })));
        }
    }

    private static float[] Three(Vector3 one) => new[] { one.x == 0 ? 0 : one.x, one.y, one.z }; // no zero below 0

    private static string Hash(System.Collections.Generic.IEnumerable<float> numbers)
    {
        float[] all = numbers.ToArray();
        var bytes = new byte[4 * all.Length];
        Buffer.BlockCopy(all, 0, bytes, 0, bytes.Length);
        using (SHA256 sha = SHA256.Create())
        {
            return BitConverter.ToString(sha.ComputeHash(bytes)).Replace("-", "").ToLowerInvariant();
        }
    }
}
